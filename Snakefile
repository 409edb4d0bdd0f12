# The workflow is where the workflow catalogue looks for it; `include:` would lose its default target.
workflow.include("workflow/Snakefile", overwrite_default_target=True)
