from benchmarks.report import Section


def run(quick: bool) -> Section:
    return Section("build", "")
