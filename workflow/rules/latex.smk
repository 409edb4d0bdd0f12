# Captions and tables as LaTeX: each by its name, or all of them with `--config latex=true`.

# By where they are in LaTeX, what they are made from.
LATEX = GRAPH.in_latex()


rule latex:
    input:
        lambda wildcards: LATEX[f"results/{wildcards.latex}.tex"],
    output:
        "results/{latex}.tex",
    log:
        "logs/{latex}.latex.log",
    wildcard_constraints:
        latex=any_of(
            path.removeprefix("results/").removesuffix(".tex") for path in LATEX
        ),
    conda:
        "../envs/reobserve.yaml"
    params:
        command=lambda wildcards, input, output: f"latex {input} --output {output}",
        code=digest_of("reobserve.stages.latex"),
    message:
        "write {output} in LaTeX"
    shell:
        RUN
