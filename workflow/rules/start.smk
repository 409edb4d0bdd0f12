# Before the first job: hold the folder, and put the ledgers where the stages read them.


onstart:
    take_build_lock()
    write_ledgers()
