# The road of every figure. A job is stale if what it reads from the ledger, the source of a module
# that it imports or a package version differs from when its output was made: `params` records
# their digests. The ledger file itself is `ancient`: it changes with any entry, a job only with
# those that it sees.


wildcard_constraints:
    paper="|".join(LEDGERS),
    scenario=names("scenarios"),
    observer=names("observers"),
    study=names("studies"),
    figure=names("figures"),


rule ledger:
    input:
        "config/papers/{paper}.yaml",
    output:
        "results/{paper}/ledger.json",
    params:
        overrides=overrides_of,
        seed=config["seed"],
        code=code("ledger"),
    log:
        "logs/{paper}/ledger.log",
    benchmark:
        "logs/{paper}/ledger.tsv"
    conda:
        "../envs/reobserve.yaml"
    message:
        "{wildcards.paper}: check the assumption ledger"
    shell:
        "reobserve ledger {wildcards.paper} {params.overrides} --seed {params.seed}"
        " --output {output} > {log} 2>&1"


rule plant:
    input:
        files=signal_files,
        ledger=ancient(ledger_file),
    output:
        "results/{paper}/{scenario}/plant.parquet",
    params:
        settings=settings("plant", "scenario"),
        code=code("plant"),
        packages=packages,
    log:
        "logs/{paper}/{scenario}/plant.log",
    benchmark:
        "logs/{paper}/{scenario}/plant.tsv"
    conda:
        "../envs/reobserve.yaml"
    message:
        "{wildcards.paper}: simulate the plant, scenario {wildcards.scenario}"
    shell:
        "reobserve plant {input.ledger} {wildcards.scenario} --output {output} > {log} 2>&1"


rule observe:
    input:
        plant="results/{paper}/{scenario}/plant.parquet",
        ledger=ancient(ledger_file),
    output:
        "results/{paper}/{scenario}/{observer}.parquet",
    params:
        settings=settings("observe", "scenario", "observer"),
        code=code("observe"),
        packages=packages,
    log:
        "logs/{paper}/{scenario}/{observer}.log",
    benchmark:
        "logs/{paper}/{scenario}/{observer}.tsv"
    conda:
        "../envs/reobserve.yaml"
    message:
        "{wildcards.paper}: run the observer {wildcards.observer}, scenario {wildcards.scenario}"
    shell:
        "reobserve observe {input.ledger} {input.plant} {wildcards.observer}"
        " --output {output} > {log} 2>&1"


rule study:
    input:
        plant=study_record,
        ledger=ancient(ledger_file),
    output:
        "results/{paper}/{study}.study.csv",
    params:
        settings=settings("study", "study"),
        code=code("study"),
        packages=packages,
    log:
        "logs/{paper}/{study}.study.log",
    benchmark:
        "logs/{paper}/{study}.study.tsv"
    conda:
        "../envs/reobserve.yaml"
    message:
        "{wildcards.paper}: run the study {wildcards.study}"
    shell:
        "reobserve study {input.ledger} {input.plant} {wildcards.study}"
        " --output {output} > {log} 2>&1"


rule metrics:
    input:
        plant=figure_record,
        estimates=figure_estimates,
        study=figure_study,
        ledger=ancient(ledger_file),
    output:
        report(
            "results/{paper}/{figure}.metrics.csv",
            caption="../report/metrics.rst",
            category="{paper}",
            subcategory="numbers",
            labels={"figure": "{figure}", "what": "metrics"},
        ),
    params:
        settings=settings("metrics", "figure"),
        study=study_option,
        code=code("metrics"),
        packages=packages,
    log:
        "logs/{paper}/{figure}.metrics.log",
    benchmark:
        "logs/{paper}/{figure}.metrics.tsv"
    conda:
        "../envs/reobserve.yaml"
    message:
        "{wildcards.paper}: judge the estimates of {wildcards.figure}"
    shell:
        "reobserve metrics {input.ledger} {wildcards.figure} --plant-file {input.plant}"
        " --estimate-files {input.estimates} {params.study} --output {output} > {log} 2>&1"


rule plot:
    input:
        plant=figure_record,
        estimates=figure_estimates,
        study=figure_study,
        metrics="results/{paper}/{figure}.metrics.csv",
        template=caption_template,
        ledger=ancient(ledger_file),
    output:
        report(
            f"results/{{paper}}/{{figure}}.{REPORTED}",
            caption="../../results/{paper}/{figure}.caption.rst",
            category="{paper}",
            subcategory="figures",
            labels={"figure": "{figure}", "what": "drawing"},
        ),
        [
            f"results/{{paper}}/{{figure}}.{suffix}"
            for suffix in config["formats"]
            if suffix != REPORTED
        ],
        caption="results/{paper}/{figure}.caption.rst",
    params:
        settings=settings("plot", "figure"),
        study=study_option,
        drawings=lambda wildcards, output: output[:-1],
        code=code("plot"),
        packages=packages,
    log:
        "logs/{paper}/{figure}.plot.log",
    benchmark:
        "logs/{paper}/{figure}.plot.tsv"
    conda:
        "../envs/reobserve.yaml"
    message:
        "{wildcards.paper}: draw {wildcards.figure}"
    shell:
        "reobserve plot {input.ledger} {wildcards.figure} --plant-file {input.plant}"
        " --estimate-files {input.estimates} {params.study} --metrics-file {input.metrics}"
        " --template {input.template} --caption {output.caption}"
        " --outputs {params.drawings} > {log} 2>&1"
