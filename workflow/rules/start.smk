# Before the first job: hold the folder, and put the ledgers where the stages read them. After a
# failure of a whole build: the report of what there is, with the gaps shown.


onstart:
    take_build_lock()
    jobs = sum(job.shellcmd is not None for job in workflow.dag.needrun_jobs())
    here = workflow.local_exec
    if here:
        start_jobs_at_any_rate()
    if sys.platform == "linux" and here and not DEPLOYED and jobs >= WORTH_FORKING:
        start_fork_server()  # it imports while ledgers are checked
    write_ledgers()


onerror:
    if not set(workflow.dag_settings.targets) - {"all"}:
        shell(f"reobserve {GRAPH.job('report').command} >&2")
