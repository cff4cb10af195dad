# The front door, in the project's folder: `snakemake --cores all [--configfile config/tiny.yaml]`.

include: "workflow/Snakefile"
