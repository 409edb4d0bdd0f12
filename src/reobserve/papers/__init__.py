"""The papers: each wires plants, observers, metrics and drawing to its ledger.

A paper is a package with one module a stage, so that a change in one stage leaves the results
of the others fresh:

    plant.simulate(settings) -> Series
    observe.estimate(settings, plant) -> Series
    study.run(settings, plant) -> list of rows        (only papers that have studies)
    metrics.measure(settings, plant, estimates, study) -> list of Metric
    plot.draw(settings, plant, estimates, study, metrics) -> matplotlib Figure
    ledger.check(ledger) -> None                      (builds everything once, runs nothing)

``settings`` are what `reobserve.ledger.Ledger.settings` returns for the stage.
"""
