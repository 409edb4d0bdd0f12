# Whether the claims hold: theory and Monte Carlo samples -> robustness -> claims -> report, verdicts.


rule theory:
    input:
        inputs_of("theory"),
    output:
        report(
            "results/{paper}/theory.metrics.csv",
            caption="../report/theory.rst",
            category="{paper}",
            subcategory="numbers",
            labels={"figure": "theory", "what": "metrics"},
        ),
    log:
        "logs/{paper}/theory.log",
    benchmark:
        "logs/{paper}/theory.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        settings=settings("theory"),
        code=code("theory"),
        packages=PACKAGES,
    message:
        "{wildcards.paper}: compute the numbers of the theory"
    shell:
        "(set -x; reobserve-papers stage theory results/{wildcards.paper}/parameters.json) &> {log}"


rule robustness:
    input:
        inputs_of("robustness"),
    output:
        "results/{paper}/robustness.json",
    log:
        "logs/{paper}/robustness.log",
    benchmark:
        "logs/{paper}/robustness.tsv"
    priority: 2
    conda:
        "../envs/reobserve.yaml"
    params:
        settings=of_claims("samples"),
        code=code("robustness"),
        packages=PACKAGES,
        options=f"--samples {config['samples']}" + ("" if config["cached"] else " --no-cached"),
    message:
        "{wildcards.paper}: compute Monte Carlo samples of what is left open"
    shell:
        "(set -x; reobserve-papers stage robustness results/{wildcards.paper}/parameters.json {params.options})"
        " &> {log}"


rule alternatives:
    input:
        inputs_of("alternatives"),
    output:
        report(
            "results/{paper}/alternatives.csv",
            caption="../report/alternatives.rst",
            category="{paper}",
            subcategory="evidence",
            labels={"figure": "claims", "what": "alternatives"},
        ),
    log:
        "logs/{paper}/alternatives.log",
    benchmark:
        "logs/{paper}/alternatives.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        claims=of_claims("verdicts"),
        code=code_of("reobserve_papers.cli.stages.alternatives"),
        packages=PACKAGES,
    message:
        "{wildcards.paper}: try alternatives to conventions"
    shell:
        "(set -x; reobserve-papers stage alternatives results/{wildcards.paper}/parameters.json) &> {log}"


rule sensitivity:
    input:
        inputs_of("sensitivity"),
    output:
        report(
            expand(
                "results/{{paper}}/{name}.{kind}",
                name=CLAIM_PLOTS,
                kind=FORMATS,
            ),
            caption="../report/sensitivity.rst",
            category="{paper}",
            subcategory="evidence",
            labels={"figure": "claims", "what": "sensitivity"},
        ),
    log:
        "logs/{paper}/sensitivity.log",
    benchmark:
        "logs/{paper}/sensitivity.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        claims=of_claims("verdicts"),
        code=code_of("reobserve_papers.cli.stages.sensitivity"),
        packages=PACKAGES,
        options=" ".join(["--formats", *FORMATS]),
    message:
        "{wildcards.paper}: plot which choices decide the claims"
    shell:
        "(set -x; reobserve-papers stage sensitivity results/{wildcards.paper}/parameters.json"
        " {params.options}) &> {log}"


rule claims:
    input:
        inputs_of("claims"),
    output:
        report(
            "results/claims.csv",
            caption="../report/claims.rst",
            category="evidence",
            labels={"figure": "all", "what": "claims"},
        ),
    log:
        "logs/claims.log",
    benchmark:
        "logs/claims.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        parameters=expand("results/{paper}/parameters.json", paper=CLAIMED),
        code=code_of("reobserve_papers.cli.stages.claims"),
        claims=lambda wildcards: [
            claims_digest("table", Path(), checked(paper)) for paper in CLAIMED
        ],
    message:
        "decide all claims"
    shell:
        "(set -x; reobserve-papers stage claims {params.parameters}) &> {log}"


rule report:
    input:
        FIGURES,
        TABLES,
        NUMBERS,
        inputs_of("verdicts"),
        expand("results/{paper}/robustness.json", paper=CLAIMED),
        expand("results/{paper}/{name}.{kind}", paper=CLAIMED, name=CLAIM_PLOTS, kind=FORMATS),
        ancient(TEXTS),
    output:
        report(
            "results/report.html",
            caption="../report/replication.rst",
            category="evidence",
            labels={"figure": "all", "what": "replication report"},
        ),
    log:
        "logs/report.log",
    benchmark:
        "logs/report.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        built=BUILT,
        bench=files_digest(*BENCH_BUILT),
        texts=files_digest(*TEXTS),
        code=code_of("reobserve_papers.report"),
        packages=PACKAGES,
    message:
        "write the replication report"
    shell:
        "(set -x; reobserve-papers report --fresh {params.built} --output {output}) &> {log}"


# After the report, which shows broken claims: this fails then.
rule verdicts:
    input:
        inputs_of("verdicts"),
        report="results/report.html",
    output:
        "results/verdicts.md",
    log:
        "logs/verdicts.log",
    conda:
        "../envs/reobserve.yaml"
    params:
        parameters=expand("results/{paper}/parameters.json", paper=CLAIMED),
        code=code_of("reobserve_papers.cli.stages.verdicts"),
        claims=lambda wildcards: [
            claims_digest("table", Path(), checked(paper)) for paper in CLAIMED
        ],
    message:
        "count the verdicts"
    shell:
        "(set -x; reobserve-papers stage verdicts {params.parameters}) 2>&1 | tee {log} | sed '\\,^+ ,d' >&2"


# On demand: the build as an RO-Crate, with the bench if built, to be deposited and cited.
rule archive:
    input:
        rules.all.input,
        NUMBERS,
        expand("results/{paper}/sensitivity.{kind}", paper=CLAIMED, kind=FORMATS),
    output:
        "results/archive.zip",
    log:
        "logs/archive.log",
    conda:
        "../envs/reobserve.yaml"
    params:
        bench=BENCH_BUILT,
        texts=files_digest("config", "workflow", "CITATION.cff", "README.md", "CHANGELOG.md"),
        code=code_of("reobserve_papers.report.research_object"),
        packages=PACKAGES,
    message:
        "pack the build"
    shell:
        "(set -x; reobserve-papers stage archive {input} {params.bench} --output {output}) 2>&1 | tee {log} >&2"
