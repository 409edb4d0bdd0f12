# What is claimed, whether it holds, and the page that tells it: theory -> robustness -> claims ->
# verdicts and report. Claims read the numbers of all figures, so these come last.


rule theory:
    input:
        designs=lambda wildcards: all_designs(wildcards.paper),
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
        ledger=ledger_file,
        settings=lambda wildcards: digest(LEDGERS[wildcards.paper].settings("theory")),
        code=code("theory"),
        packages=packages,
    message:
        "{wildcards.paper}: compute the numbers of the theory"
    shell:
        "(set -x; reobserve theory {params.ledger:q} --design-files {input.designs:q}"
        " --output {output:q}) > {log:q} 2>&1"


rule robustness:
    output:
        "results/{paper}/robustness.json",
    log:
        "logs/{paper}/robustness.log",
    benchmark:
        "logs/{paper}/robustness.tsv"
    # It waits for nothing and takes longest.
    priority: 2
    conda:
        "../envs/reobserve.yaml"
    params:
        ledger=ledger_file,
        draws=config["draws"],
        flips="" if config["flips"] else "--no-flips",
        settings=lambda wildcards: digest(drawn_from(wildcards.paper)),
        code=code("robustness"),
        packages=packages,
    message:
        "{wildcards.paper}: decide the claims over {params.draws} draws of what is left open"
    shell:
        "(set -x; reobserve robustness {params.ledger:q} --draws {params.draws:q}"
        " {params.flips} --output {output:q}) > {log:q} 2>&1"


rule claims:
    input:
        metrics=numbers(),
        robustness=[f"results/{paper}/robustness.json" for paper in CLAIMED],
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
        papers=CLAIMED,
        settings=lambda wildcards: digest(told_of_claims()),
        code=digest_of("reobserve.stages.claims"),
    message:
        "decide all claims"
    shell:
        "(set -x; reobserve claims {params.papers:q} --output {output:q}) > {log:q} 2>&1"


rule report:
    input:
        products(),
        "results/claims.csv",
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
        built=report_options(),
        settings=lambda wildcards: digest(told_in_report()),
        code=digest_of("reobserve.evidence.report"),
        packages=packages,
    message:
        "write the replication report"
    shell:
        "(set -x; reobserve report {params.built:q} --output {output:q}) > {log:q} 2>&1"


# After the report, which shows what is broken: this is what fails then.
rule verdicts:
    input:
        claims="results/claims.csv",
        report="results/report.html",
    output:
        "results/verdicts.md",
    log:
        "logs/verdicts.log",
    conda:
        "../envs/reobserve.yaml"
    params:
        settings=lambda wildcards: digest(
            [LEDGERS[paper].section("figures") for paper in CLAIMED]
        ),
        code=digest_of("reobserve.stages.verdicts"),
    message:
        "count the verdicts"
    shell:
        "(set -x; reobserve verdicts {input.claims:q} --output {output:q}) 2>&1 | tee {log:q} >&2"
