# From parameters to records: plants, the designs that observers share, observers, and studies.


rule plant:
    input:
        recorded,
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
        "(set -x; reobserve-papers stage plant results/{wildcards.paper}/parameters.json {wildcards.scenario}"
        " --output {output}) &> {log}"


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
        "(set -x; reobserve-papers stage design results/{wildcards.paper}/parameters.json {wildcards.design}"
        " --output {output}) &> {log}"


rule observe:
    input:
        plant="results/{paper}/{scenario}/plant.parquet",
        design=design_of("observers", "observer"),
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
        "(set -x; reobserve-papers stage observe results/{wildcards.paper}/parameters.json {input.plant}"
        " {wildcards.observer} --design-file {input.design} --output {output}) &> {log}"


rule study:
    input:
        plant=plant_of("studies", "study"),
        design=design_of("studies", "study"),
        files=files_of,
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
        "(set -x; reobserve-papers stage study results/{wildcards.paper}/parameters.json {input.plant}"
        " {wildcards.study} --design-file {input.design} --output {output}) &> {log}"


# On demand: what a search has found is kept in config/searches, where studies read it.
rule search:
    input:
        plant=plant_of("searches", "search"),
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
        "(set -x; reobserve-papers stage search results/{wildcards.paper}/parameters.json {input.plant}"
        " {wildcards.search} --output {output}) 2>&1 | tee {log} >&2"
