# From records to what readers see: metrics, plots with captions, and tables.

STYLE = [path for path in [style_sheet(Path(), config["style"])] if Path(path).is_file()]
DRAWN = ["--style", config["style"]] * len(STYLE) + ["--no-notes"] * (not config["notes"])


rule metrics:
    input:
        inputs_of("metrics"),
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
        settings=settings("metrics", "figure"),
        code=code("metrics"),
        packages=PACKAGES,
    message:
        "{wildcards.paper}: compute the metrics of {wildcards.figure}"
    shell:
        "(set -x; reobserve-papers stage metrics results/{wildcards.paper}/parameters.json {wildcards.figure}) &> {log}"


rule plot:
    input:
        inputs_of("plot"),
    output:
        report(
            f"results/{{paper}}/{{figure}}.{FORMATS[0]}",
            caption="../report/caption.rst",
            category="{paper}",
            subcategory="figures",
            labels={"figure": "{figure}", "what": "drawing"},
        ),
        expand("results/{{paper}}/{{figure}}.{kind}", kind=FORMATS[1:]),
        caption="results/{paper}/{figure}.caption.rst",
    log:
        "logs/{paper}/{figure}.plot.log",
    benchmark:
        "logs/{paper}/{figure}.plot.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        settings=settings("plot", "figure"),
        code=code("plot"),
        packages=PACKAGES,
        options=" ".join(["--formats", *FORMATS, *DRAWN]),
    message:
        "{wildcards.paper}: plot {wildcards.figure}"
    shell:
        "(set -x; reobserve-papers stage plot results/{wildcards.paper}/parameters.json {wildcards.figure}"
        " {params.options}) &> {log}"


rule table:
    input:
        inputs_of("table"),
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
        settings=settings("table", "table"),
        code=code("table"),
        packages=PACKAGES,
        caption=table_caption,
    message:
        "{wildcards.paper}: compute the table {wildcards.table}"
    shell:
        "(set -x; reobserve-papers stage table results/{wildcards.paper}/parameters.json {wildcards.table}) &> {log}"


# A caption or a table as LaTeX: by its name, or all of them with `--config latex=true`.
rule latex:
    input:
        lambda wildcards: f"results/{wildcards.of}.{'rst' if wildcards.of.endswith('.caption') else 'csv'}",
    output:
        "results/{of}.tex",
    log:
        "logs/{of}.latex.log",
    conda:
        "../envs/reobserve.yaml"
    params:
        code=code_of("reobserve_papers.cli.stages.latex"),
    message:
        "write {output}"
    shell:
        "(set -x; reobserve-papers latex {input} --output {output}) &> {log}"
