"""The papers: each connects plants, observers, metrics and plots to its parameters.

A paper is a package with one module per step, so that an edit of one step leaves the results of
the others up to date:

    plant.simulate(job) -> Series
    design.compute(job) -> dict                  (only papers that have designs)
    observe.estimate(job, plant) -> Series
    study.run(job, plant) -> list of rows                    (only with studies)
    study_rows.HEADER: the columns of their table, which figures read, too
    table.HEADER, table.rows(job, design) -> list of rows    (only with tables)
    study_rows.KINDS, table.KINDS: what the cells of a column must be
                                                      (see `reobserve.core.files.Kind`)
    theory.measure(job, designs) -> list of Metric           (only with a section `theory`)
    metrics.measure(data) -> Metrics
                                     (see `reobserve_papers.parameters.figure_data`)
    metrics.MEANINGS: what each metric is, in words   (see `reobserve_papers.steps.glossary`)
    metrics.SUBJECTS: what else than observers it is of                  (see there)
    plot.LAYOUTS: what draws a figure, by its layout: draw(data) -> matplotlib Figure
    search.run(job, plant, progress) -> dict     (only papers that have searches)
    keys.Parameters                               (the keys of the parameter file, as dataclasses)
    checks.CHECKS: how what the parameter file states is built, once
                                           (see `reobserve_papers.parameters.parameter_checks`)

A design is plain JSON data: gains and series that are computed once. Observers and studies that
name one in the parameter file get it as a third argument.

What studies and figures have in common, the keys of papers take from
`reobserve_papers.parameters.job`. ``job`` is a `reobserve_papers.parameters.job.Job`: the
parameter values that the step reads, see `reobserve_papers.parameters.settings`, with the types
that the paper declares. The end of its keys names these types, ``Job = job.Job[Plant, Scenario,
...]``, so that mypy refuses a misspelled field in any step; ``Parameters = job.sections(Job)``.
A step that is called by hand with plain values is given ``read_job(keys.Parameters, settings)``.
"""

from reobserve.core.extras import require

require("pydantic", "replicate papers", "papers")
