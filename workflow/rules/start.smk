# Before the first job: hold the folder, and put the ledgers where the stages read them. After a
# failure: the report of what there is, with the gaps shown.


onstart:
    take_build_lock()
    write_ledgers()


onerror:
    shell(f"reobserve report {report_options()} --output results/report.html >&2")
