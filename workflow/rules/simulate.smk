# From parameters to records: plants, the designs that observers share, observers, and studies.


rule plant:
    input:
        inputs_of("plant"),
    output:
        "results/{paper}/{scenario}/plant.parquet",
    log:
        "logs/{paper}/{scenario}/plant.log",
    benchmark:
        "logs/{paper}/{scenario}/plant.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        settings=settings("plant", "scenario"),
        code=code("plant"),
        packages=PACKAGES,
    message:
        "{wildcards.paper}: simulate the plant, scenario {wildcards.scenario}"
    shell:
        "(set -x; reobserve-papers stage plant results/{wildcards.paper}/parameters.json {wildcards.scenario}) &> {log}"


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
        settings=settings("design", "design"),
        code=code("design"),
        packages=PACKAGES,
    message:
        "{wildcards.paper}: compute the design {wildcards.design}"
    shell:
        "(set -x; reobserve-papers stage design results/{wildcards.paper}/parameters.json {wildcards.design}) &> {log}"


rule observe:
    input:
        inputs_of("observe"),
    output:
        "results/{paper}/{scenario}/{observer}.parquet",
    log:
        "logs/{paper}/{scenario}/{observer}.log",
    benchmark:
        "logs/{paper}/{scenario}/{observer}.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        settings=settings("observe", "observer"),
        code=code("observe"),
        packages=PACKAGES,
    message:
        "{wildcards.paper}: run the observer {wildcards.observer}, scenario {wildcards.scenario}"
    shell:
        "(set -x; reobserve-papers stage observe results/{wildcards.paper}/parameters.json"
        " {wildcards.scenario} {wildcards.observer}) &> {log}"


rule study:
    input:
        inputs_of("study"),
    output:
        "results/{paper}/{study}.study.csv",
    log:
        "logs/{paper}/{study}.study.log",
    benchmark:
        "logs/{paper}/{study}.study.tsv"
    priority: 1  # long jobs first, so that a build does not end with one of them alone
    conda:
        "../envs/reobserve.yaml"
    params:
        settings=settings("study", "study"),
        code=code("study"),
        packages=PACKAGES,
    message:
        "{wildcards.paper}: run the study {wildcards.study}"
    shell:
        "(set -x; reobserve-papers stage study results/{wildcards.paper}/parameters.json {wildcards.study}) &> {log}"


# On demand: what a search has found is kept in config/searches, where studies read it.
rule search:
    input:
        inputs_of("search"),
    output:
        "results/{paper}/{search}.search.json",
    log:
        "logs/{paper}/{search}.search.log",
    benchmark:
        "logs/{paper}/{search}.search.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        settings=settings("search", "search"),
        code=code("search"),
        packages=PACKAGES,
    message:
        "{wildcards.paper}: search {wildcards.search}, some minutes"
    shell:
        "(set -x; reobserve-papers stage search results/{wildcards.paper}/parameters.json {wildcards.search}) 2>&1 | tee {log} >&2"
