# The road of every figure and table. A job is stale if what it reads from the ledger, the source of
# a module that it imports or a package version differs from when its output was made: `params`
# records their digests. The ledger itself is no input: its time stamp changes with any entry, a job
# only with those that it sees.


wildcard_constraints:
    paper=any_of(LEDGERS),
    chunk=r"\d+-\d+",
    scenario=names("scenarios"),
    design=names("designs"),
    observer=names("observers"),
    study=names("studies"),
    search=names("searches"),
    table=names("tables"),
    figure=names("figures"),


rule plant:
    input:
        unpack(inputs("plant")),
    output:
        outputs("plant"),
    log:
        log_of("plant"),
    benchmark:
        log_of("plant", ".tsv")
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("plant"),
        settings=settings("plant"),
        code=code("plant"),
        packages=packages,
    message:
        "{wildcards.paper}: simulate the plant, scenario {wildcards.scenario}"
    shell:
        RUN


rule design:
    input:
        unpack(inputs("design")),
    output:
        outputs("design"),
    log:
        log_of("design"),
    benchmark:
        log_of("design", ".tsv")
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("design"),
        settings=settings("design"),
        code=code("design"),
        packages=packages,
    message:
        "{wildcards.paper}: compute the design {wildcards.design}"
    shell:
        RUN


rule observe:
    input:
        unpack(inputs("observe")),
    output:
        outputs("observe"),
    log:
        log_of("observe"),
    benchmark:
        log_of("observe", ".tsv")
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("observe"),
        settings=settings("observe"),
        code=code("observe"),
        packages=packages,
    message:
        "{wildcards.paper}: run the observer {wildcards.observer}, scenario {wildcards.scenario}"
    shell:
        RUN


rule study:
    input:
        unpack(inputs("study")),
    output:
        outputs("study"),
    log:
        log_of("study"),
    benchmark:
        log_of("study", ".tsv")
    # The longest job: begun as soon as it can be, it does not hold up the end of a build.
    priority: 1
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("study"),
        settings=settings("study"),
        code=code("study"),
        packages=packages,
    message:
        "{wildcards.paper}: run the study {wildcards.study}"
    shell:
        RUN


# No figure asks for this one: what it found is kept under config/searches, where studies read it.
rule search:
    input:
        unpack(inputs("search")),
    output:
        outputs("search"),
    log:
        log_of("search"),
    benchmark:
        log_of("search", ".tsv")
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("search"),
        settings=settings("search"),
        code=code("search"),
        packages=packages,
    message:
        "{wildcards.paper}: search {wildcards.search}, some minutes"
    shell:
        RUN_AND_TELL


rule table:
    input:
        unpack(inputs("table")),
    output:
        report(
            outputs("table"),
            caption="../report/table_caption.rst",
            category="{paper}",
            subcategory="tables",
            labels={"figure": "{table}", "what": "table"},
        ),
    log:
        log_of("table"),
    benchmark:
        log_of("table", ".tsv")
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("table"),
        caption=table_caption,
        settings=settings("table"),
        code=code("table"),
        packages=packages,
    message:
        "{wildcards.paper}: fill {wildcards.table}"
    shell:
        RUN


rule metrics:
    input:
        unpack(inputs("metrics")),
    output:
        report(
            outputs("metrics"),
            caption="../report/metrics.rst",
            category="{paper}",
            subcategory="numbers",
            labels={"figure": "{figure}", "what": "metrics"},
        ),
    log:
        log_of("metrics"),
    benchmark:
        log_of("metrics", ".tsv")
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("metrics"),
        settings=settings("metrics"),
        code=code("metrics"),
        packages=packages,
    message:
        "{wildcards.paper}: judge the estimates of {wildcards.figure}"
    shell:
        RUN


rule plot:
    input:
        unpack(inputs("plot")),
    output:
        report(
            outputs("plot")[0],
            caption="../report/caption.rst",
            category="{paper}",
            subcategory="figures",
            labels={"figure": "{figure}", "what": "drawing"},
        ),
        outputs("plot")[1:-1],
        caption=outputs("plot")[-1],
    log:
        log_of("plot"),
    benchmark:
        log_of("plot", ".tsv")
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("plot"),
        settings=settings("plot"),
        style=sheet,
        code=code("plot"),
        packages=packages,
    message:
        "{wildcards.paper}: draw {wildcards.figure}"
    shell:
        RUN
