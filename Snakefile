# The front door, in the project's folder: `snakemake --cores all [--configfile config/tiny.yaml]`.


include: "workflow/Snakefile"


workflow.default_target = "all"  # which an included file cannot set
