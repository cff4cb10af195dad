# The study's front door: `snakemake --cores all [--configfile config/tiny.yaml]`.
# Configuration and its checks, what is to be made, and one file of rules per group of stages.

configfile: "config/config.yaml"

include: "workflow/rules/common.smk"


rule all:
    input:
        f"{RESULTS}/report.html",
        lambda wildcards: everything(workflow),


include: "workflow/rules/materials.smk"
include: "workflow/rules/ftir.smk"
include: "workflow/rules/sensor.smk"
include: "workflow/rules/objects.smk"
include: "workflow/rules/published.smk" if STUDY.archive else "workflow/rules/presses.smk"
include: "workflow/rules/learning.smk"
include: "workflow/rules/report.smk"
