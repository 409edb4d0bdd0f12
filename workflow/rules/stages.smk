# The road of every figure and table. A job is stale if what it reads from the ledger, the source of
# a module that it imports or a package version differs from when its output was made: `params`
# records their digests. The ledger itself is no input: its time stamp changes with any entry, a job
# only with those that it sees.


wildcard_constraints:
    paper=any_of(LEDGERS),
    scenario=names("scenarios"),
    design=names("designs"),
    observer=names("observers"),
    study=names("studies"),
    search=names("searches"),
    table=names("tables"),
    figure=names("figures"),


rule plant:
    input:
        signal_files,
    output:
        "results/{paper}/{scenario}/plant.parquet",
    log:
        "logs/{paper}/{scenario}/plant.log",
    benchmark:
        "logs/{paper}/{scenario}/plant.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        ledger=ledger_file,
        settings=settings("plant", "scenario"),
        code=code("plant"),
        packages=packages,
    message:
        "{wildcards.paper}: simulate the plant, scenario {wildcards.scenario}"
    shell:
        "(set -x; reobserve plant {params.ledger:q} {wildcards.scenario:q} --output {output:q}) > {log:q} 2>&1"


rule design:
    output:
        "results/{paper}/{design}.design.json",
    log:
        "logs/{paper}/{design}.design.log",
    benchmark:
        "logs/{paper}/{design}.design.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        ledger=ledger_file,
        settings=settings("design", "design"),
        code=code("design"),
        packages=packages,
    message:
        "{wildcards.paper}: compute the design {wildcards.design}"
    shell:
        "(set -x; reobserve design {params.ledger:q} {wildcards.design:q} --output {output:q}) > {log:q} 2>&1"


rule observe:
    input:
        plant="results/{paper}/{scenario}/plant.parquet",
        design=named_design("observers", "observer"),
    output:
        "results/{paper}/{scenario}/{observer}.parquet",
    log:
        "logs/{paper}/{scenario}/{observer}.log",
    benchmark:
        "logs/{paper}/{scenario}/{observer}.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        ledger=ledger_file,
        settings=settings("observe", "scenario", "observer"),
        design=design_option,
        code=code("observe"),
        packages=packages,
    message:
        "{wildcards.paper}: run the observer {wildcards.observer}, scenario {wildcards.scenario}"
    shell:
        "(set -x; reobserve observe {params.ledger:q} {input.plant:q} {wildcards.observer:q}"
        " {params.design:q} --output {output:q}) > {log:q} 2>&1"


rule study:
    input:
        plant=record_of("studies", "study"),
        files=study_files,
        design=named_design("studies", "study"),
    output:
        "results/{paper}/{study}.study.csv",
    log:
        "logs/{paper}/{study}.study.log",
    benchmark:
        "logs/{paper}/{study}.study.tsv"
    # The longest job: begun as soon as it can be, it does not hold up the end of a build.
    priority: 1
    conda:
        "../envs/reobserve.yaml"
    params:
        ledger=ledger_file,
        settings=settings("study", "study"),
        design=design_option,
        code=code("study"),
        packages=packages,
    message:
        "{wildcards.paper}: run the study {wildcards.study}"
    shell:
        "(set -x; reobserve study {params.ledger:q} {input.plant:q} {wildcards.study:q}"
        " {params.design:q} --output {output:q}) > {log:q} 2>&1"


# No figure asks for this one: what it found is kept under config/searches, where studies read it.
rule search:
    input:
        plant=record_of("searches", "search"),
    output:
        "results/{paper}/{search}.search.json",
    log:
        "logs/{paper}/{search}.search.log",
    benchmark:
        "logs/{paper}/{search}.search.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        ledger=ledger_file,
        settings=settings("search", "search"),
        code=code("search"),
        packages=packages,
    message:
        "{wildcards.paper}: search {wildcards.search}, some minutes"
    shell:
        "(set -x; reobserve search {params.ledger:q} {input.plant:q} {wildcards.search:q}"
        " --output {output:q}) 2>&1 | tee {log:q} >&2"


rule table:
    input:
        design=named_design("tables", "table"),
    output:
        report(
            "results/{paper}/{table}.csv",
            caption="../report/table_caption.rst",
            category="{paper}",
            subcategory="tables",
            labels={"figure": "{table}", "what": "table"},
        ),
    log:
        "logs/{paper}/{table}.table.log",
    benchmark:
        "logs/{paper}/{table}.table.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        ledger=ledger_file,
        settings=settings("table", "table"),
        caption=table_caption,
        code=code("table"),
        packages=packages,
    message:
        "{wildcards.paper}: fill {wildcards.table}"
    shell:
        "(set -x; reobserve table {params.ledger:q} {wildcards.table:q} --design-file {input.design:q}"
        " --output {output:q}) > {log:q} 2>&1"


rule metrics:
    input:
        plant=record_of("figures", "figure"),
        estimates=figure_estimates,
        study=figure_study,
    output:
        report(
            "results/{paper}/{figure}.metrics.csv",
            caption="../report/metrics.rst",
            category="{paper}",
            subcategory="numbers",
            labels={"figure": "{figure}", "what": "metrics"},
        ),
    log:
        "logs/{paper}/{figure}.metrics.log",
    benchmark:
        "logs/{paper}/{figure}.metrics.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        ledger=ledger_file,
        settings=settings("metrics", "figure"),
        study=study_option,
        code=code("metrics"),
        packages=packages,
    message:
        "{wildcards.paper}: judge the estimates of {wildcards.figure}"
    shell:
        "(set -x; reobserve metrics {params.ledger:q} {wildcards.figure:q} --plant-file {input.plant:q}"
        " --estimate-files {input.estimates:q} {params.study:q} --output {output:q}) > {log:q} 2>&1"


rule plot:
    input:
        plant=record_of("figures", "figure"),
        estimates=figure_estimates,
        study=figure_study,
        metrics="results/{paper}/{figure}.metrics.csv",
        template=caption_template,
        partials=caption_partials,
    output:
        report(
            f"results/{{paper}}/{{figure}}.{REPORTED}",
            caption="../report/caption.rst",
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
    log:
        "logs/{paper}/{figure}.plot.log",
    benchmark:
        "logs/{paper}/{figure}.plot.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        ledger=ledger_file,
        settings=settings("plot", "figure"),
        study=study_option,
        drawings=lambda wildcards, output: output[:-1],
        code=code("plot"),
        packages=packages,
    message:
        "{wildcards.paper}: draw {wildcards.figure}"
    shell:
        "(set -x; reobserve plot {params.ledger:q} {wildcards.figure:q} --plant-file {input.plant:q}"
        " --estimate-files {input.estimates:q} {params.study:q} --metrics-file {input.metrics:q}"
        " --template {input.template:q} --caption {output.caption:q}"
        " --outputs {params.drawings:q}) > {log:q} 2>&1"
