# The bench: observers and filters on the same tasks, tuned by one rule, scored on held-out records.
#   results/bench/{task}/tuned              rule bench_methods  tuned settings, on demand
#   results/bench/{task}/scores.csv         rule bench_scores   of each run; table.csv compares methods
#   results/bench/{task}/heatmap.{pdf,...}  rule bench_figures  and levels, evaluations; for leak detection
#   results/bench/table.md                  rule bench_table    what methods know, guarantee and cost
#
# Jobs that read records simulate them. Tuned settings are kept in config/bench/tuned; `snakemake bench_tune` tunes again.


rule bench_methods:
    input:
        "config/bench/{task}.yaml",
    output:
        directory("results/bench/{task}/tuned"),
    log:
        "logs/bench/{task}/tuned.log",
    benchmark:
        "logs/bench/{task}/tuned.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        code=code_of_task,
        packages=PACKAGES,
        stored="--stored config/bench/tuned/{task}",
    message:
        "bench, {wildcards.task}: tune all methods"
    shell:
        "(set -x; reobserve-papers bench tune {input} {params.stored} --output {output}) 2>&1 | tee {log} >&2"


# After all are tuned: this fails if the error of a method has moved by more than its interval.
rule bench_moved:
    input:
        task="config/bench/{task}.yaml",
        again="results/bench/{task}/tuned",
    output:
        "results/bench/{task}/moved.csv",
    log:
        "logs/bench/{task}/moved.log",
    conda:
        "../envs/reobserve.yaml"
    params:
        code=code_of_task,
        packages=PACKAGES,
    message:
        "bench, {wildcards.task}: compare the kept settings with those tuned again"
    shell:
        "(set -x; reobserve-papers bench moved {input.task} --cached config/bench/tuned/{wildcards.task}"
        " --again {input.again} --output {output}) &> {log}"


rule bench_scores:
    input:
        task="config/bench/{task}.yaml",
        tuned=tuned_settings,
    output:
        "results/bench/{task}/scores.csv",
        report(
            "results/bench/{task}/table.csv",
            caption="../report/bench/table.rst",
            category="bench",
            subcategory="{task}",
            labels={"figure": "{task}", "what": "table"},
        ),
    log:
        "logs/bench/{task}/scores.log",
    benchmark:
        "logs/bench/{task}/scores.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        code=code_of_task,
        packages=PACKAGES,
    message:
        "bench, {wildcards.task}: score all methods on held-out records"
    shell:
        "(set -x; reobserve-papers bench score {input.task} --tuned config/bench/tuned/{wildcards.task}"
        " --outputs {output}) &> {log}"


rule bench_figures:
    input:
        task="config/bench/{task}.yaml",
        table="results/bench/{task}/table.csv",
        tuned=tuned_settings,
    output:
        *[
            report(
                f"results/bench/{{task}}/{name}.{FORMATS[0]}",
                caption=f"../report/bench/{name}.rst",
                category="bench",
                subcategory="{task}",
                labels={"figure": "{task}", "what": name},
            )
            for name in ("heatmap", "levels", "evaluations")
        ],
        expand(
            "results/bench/{{task}}/{name}.{kind}",
            name=["heatmap", "levels", "evaluations"],
            kind=FORMATS[1:],
        ),
    log:
        "logs/bench/{task}/figures.log",
    benchmark:
        "logs/bench/{task}/figures.tsv"
    conda:
        "../envs/reobserve.yaml"
    params:
        code=code_of("reobserve_papers.bench.bench_figures"),
        packages=PACKAGES,
        style=[Path(sheet).read_text(encoding="utf-8") for sheet in STYLE],
        options=" ".join(["--style", *STYLE]),
    message:
        "bench, {wildcards.task}: plot"
    shell:
        "(set -x; reobserve-papers bench plot {input.task} --table {input.table} --tuned config/bench/tuned/{wildcards.task}"
        " {params.options} --outputs {output}) &> {log}"


use rule bench_figures as bench_detection with:
    output:
        report(
            f"results/bench/{{task}}/detection.{FORMATS[0]}",
            caption="../report/bench/detection.rst",
            category="bench",
            subcategory="{task}",
            labels={"figure": "{task}", "what": "detection"},
        ),
        expand("results/bench/{{task}}/detection.{kind}", kind=FORMATS[1:]),
    log:
        "logs/bench/{task}/detection.log",
    benchmark:
        "logs/bench/{task}/detection.tsv"


rule bench_table:
    input:
        [
            f"config/bench/tuned/{task}/{method}.json"
            for task in BENCH
            for method in methods_of(task)
        ],
        expand("results/bench/{task}/table.csv", task=BENCH),
    output:
        "results/bench/table.md",
    log:
        "logs/bench/table.log",
    conda:
        "../envs/reobserve.yaml"
    params:
        folders=expand("results/bench/{task}", task=BENCH),
        code=code_of("reobserve.tuning.results"),
    message:
        "bench: write the table of all methods"
    shell:
        "(set -x; reobserve-papers bench table {params.folders} --output {output}) &> {log}"
