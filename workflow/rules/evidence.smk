# What is claimed, whether it holds, and the page that tells it: theory -> robustness -> sensitivity
# and claims -> verdicts and report. Claims read the numbers of all figures, so these come last.


rule theory:
    input:
        unpack(inputs("theory")),
    output:
        report(
            outputs("theory"),
            caption="../report/theory.rst",
            category="{paper}",
            subcategory="numbers",
            labels={"figure": "theory", "what": "metrics"},
        ),
    log:
        log_of("theory"),
    benchmark:
        log_of("theory", ".tsv")
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("theory"),
        settings=settings("theory"),
        code=code("theory"),
        packages=packages,
    message:
        "{wildcards.paper}: compute the numbers of the theory"
    shell:
        RUN


# None of these jobs with `chunks=1`: then the robustness makes all draws itself. What is in a chunk
# stays right whatever is kept or drawn besides, so other files are awaited, and their age is none.
rule draw:
    input:
        unpack(ageless_inputs("draw")),
    output:
        outputs("draw"),
    log:
        log_of("draw"),
    benchmark:
        log_of("draw", ".tsv")
    priority: 2
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("draw"),
        settings=lambda wildcards: digest(drawn_from(wildcards.paper)),
        code=code("draw"),
        packages=packages,
    message:
        "{wildcards.paper}: make the draws {wildcards.chunk} of what is left open"
    shell:
        RUN


rule robustness:
    input:
        unpack(inputs("robustness")),
    output:
        outputs("robustness"),
    log:
        log_of("robustness"),
    benchmark:
        log_of("robustness", ".tsv")
    priority: 2
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("robustness"),
        settings=lambda wildcards: digest(drawn_from(wildcards.paper)),
        code=code("robustness"),
        packages=packages,
    message:
        "{wildcards.paper}: decide the claims over draws of what is left open"
    shell:
        RUN


rule sensitivity:
    input:
        unpack(inputs("sensitivity")),
    output:
        report(
            outputs("sensitivity"),
            caption="../report/sensitivity.rst",
            category="{paper}",
            subcategory="evidence",
            labels={"figure": "claims", "what": "sensitivity"},
        ),
    log:
        log_of("sensitivity"),
    benchmark:
        log_of("sensitivity", ".tsv")
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("sensitivity"),
        settings=lambda wildcards: digest(drawn_of_claims(wildcards.paper)),
        code=digest_of("reobserve.stages.sensitivity"),
        packages=packages,
    message:
        "{wildcards.paper}: draw what decides the claims"
    shell:
        RUN


rule claims:
    input:
        unpack(inputs("claims")),
    output:
        report(
            outputs("claims"),
            caption="../report/claims.rst",
            category="evidence",
            labels={"figure": "all", "what": "claims"},
        ),
    log:
        log_of("claims"),
    benchmark:
        log_of("claims", ".tsv")
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("claims"),
        settings=lambda wildcards: digest(told_of_claims()),
        code=digest_of("reobserve.stages.claims"),
    message:
        "decide all claims"
    shell:
        RUN


rule report:
    input:
        unpack(inputs("report")),
    output:
        report(
            outputs("report"),
            caption="../report/replication.rst",
            category="evidence",
            labels={"figure": "all", "what": "replication report"},
        ),
    log:
        log_of("report"),
    benchmark:
        log_of("report", ".tsv")
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("report"),
        settings=lambda wildcards: digest(told_in_report()),
        code=digest_of("reobserve.evidence.report"),
        packages=packages,
    message:
        "write the replication report"
    shell:
        RUN


# After the report, which shows what is broken: this is what fails then.
rule verdicts:
    input:
        unpack(inputs("verdicts")),
    output:
        outputs("verdicts"),
    log:
        log_of("verdicts"),
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("verdicts"),
        settings=lambda wildcards: digest(
            [LEDGERS[paper].section("figures") for paper in GRAPH.claimed]
        ),
        code=digest_of("reobserve.stages.verdicts"),
    message:
        "count the verdicts"
    shell:
        RUN_AND_TELL


# On demand, as `make archive`: everything above, to be deposited and cited.
rule archive:
    input:
        unpack(inputs("archive")),
    output:
        outputs("archive"),
    log:
        log_of("archive"),
    conda:
        "../envs/reobserve.yaml"
    params:
        command=command("archive"),
        settings=lambda wildcards: digest(told_in_report()),
        code=digest_of("reobserve.stages.archive"),
        packages=packages,
    message:
        "pack the build"
    shell:
        RUN_AND_TELL
