# Before the first job: hold the folder, and put the ledgers where the stages read them. After a
# failure of a whole build: the report of what there is, with the gaps shown.


onstart:
    take_build_lock()
    write_ledgers()
    if sys.platform == "linux" and workflow.local_exec and not DEPLOYED:
        start_fork_server()


onerror:
    if not set(workflow.dag_settings.targets) - {"all"}:
        shell(f"reobserve {GRAPH.job('report').command} >&2")
