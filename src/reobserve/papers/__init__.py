"""The papers: each wires plants, observers, metrics and drawing to its ledger.

A paper is a package with one module a stage, so that a change in one stage leaves the results
of the others fresh:

    plant.simulate(settings) -> Series
    record.plant, record.estimates: what records and estimates must hold when they are read
    record.axis, record.EVENTS       (only where it is not the plant's, and where there are any)
    design.compute(settings) -> dict                  (only papers that have designs)
    observe.estimate(settings, plant) -> Series
    study.run(settings, plant) -> list of rows                    (only with studies)
    study_rows.HEADER: the columns of their table, which figures read, too
    table.HEADER, table.rows(settings, design) -> list of rows    (only with tables)
    study_rows.KINDS, table.KINDS: what the cells of a column must be
                                                      (see `reobserve.plain_data.files.Kind`)
    theory.measure(settings, designs) -> list of Metric           (only with a section `theory`)
    metrics.measure(data) -> Metrics                  (see `reobserve.ledger.figure_data`)
    metrics.MEANINGS: what each metric is, in words   (see `reobserve.evidence.meanings`)
    plot.LAYOUTS: what draws a figure, by its layout: draw(data) -> matplotlib Figure
    search.run(settings, plant, progress) -> dict     (only papers that have searches)
    keys.Ledger                                       (the keys of the ledger, as dataclasses)
    ledger.CHECKS: how what the ledger states is built, once     (see `reobserve.ledger.check`)

A design is plain JSON data: gains and series that are computed once. Observers and studies that
name one in the ledger get it as a third argument.

What studies, figures and records have in common, the keys of papers take from
`reobserve.ledger.types`. ``settings`` are what `reobserve.ledger.ledger.Ledger.settings` returns
for the stage. A stage makes a `reobserve.ledger.types.Job` of them before it uses any, by the same
types that the whole ledger is checked with before a build:
``job = read_job(keys.Ledger, settings)``.
"""
