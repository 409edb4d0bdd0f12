"""The papers: each wires plants, observers, metrics and drawing to its ledger.

A paper is a package with one module a stage, so that a change in one stage leaves the results
of the others fresh:

    plant.simulate(settings) -> Series
    record.axis, plant, estimates, EVENTS: what records and estimates must hold when they are read
    design.compute(settings) -> dict                  (only papers that have designs)
    observe.estimate(settings, plant) -> Series
    study.HEADER, study.run(settings, plant) -> list of rows      (only with studies)
    table.HEADER, table.rows(settings, design) -> list of rows    (only with tables)
    study.KINDS, table.KINDS: what the cells of a column must be
                                                      (see `reobserve.plain_data.files.Kind`)
    theory.measure(settings, designs) -> list of Metric           (only with a section `theory`)
    metrics.measure(settings, plant, estimates, study) -> list of Metric
    metrics.MEANINGS: what each number is, those of the theory included
                                                      (see `reobserve.evidence.meanings`)
    plot.draw(settings, plant, estimates, study, metrics) -> matplotlib Figure
                                                      (by `reobserve.drawing.layouts.by_layout`)
    search.run(settings, plant, progress) -> dict     (only papers that have searches)
    keys.Ledger                                       (the keys of the ledger, as dataclasses)
    ledger.check(keys.Ledger) -> None                 (builds everything once, runs nothing)

A design is plain JSON data: gains and series that are computed once. Observers and studies that
name one in the ledger get it as a third argument.

``settings`` are what `reobserve.ledger.ledger.Ledger.settings` returns for the stage. A stage makes
a `reobserve.ledger.types.Job` of them before it uses any, by the same types that the whole ledger
is checked with before a build: ``job = read_job(keys.Ledger, settings)``.
"""
