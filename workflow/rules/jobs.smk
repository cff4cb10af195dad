# The rules of a study that lists its jobs (`softtact.studies.KIND.jobs`): one for each stage, made from the list, so that the workflow
# and `softtact KIND`, which runs the same list without Snakemake, describe nothing twice. KIND.smk includes this file, and says before
# it what is not the study's: RESOURCES = {stage: {mem_mb, runtime, ...}}, RETRIES = {stage: how often}.

import re

from softtact.studies.jobs import paths_of

JOBS = {}  # {stage: {its wildcards' values: job}}
for _job in OPENED.jobs(RESULTS):
    JOBS.setdefault(_job.stage, {})[tuple(_job.wildcards.items())] = _job


def job_of(stage):
    """What finds a stage's job by the rule's wildcards."""
    return lambda wildcards: JOBS[stage][tuple((name, wildcards[name]) for name in first_job(stage).wildcards)]


def first_job(stage):
    """Of a stage; all its jobs have the same names of outputs and wildcards."""
    return next(iter(JOBS[stage].values()))


def inputs_of(stage):
    """A function of the wildcards: a job's named inputs."""
    found = job_of(stage)
    return lambda wildcards: dict(found(wildcards).inputs)


def settings_of(stage):
    """A function of the wildcards: a job's settings."""
    found = job_of(stage)
    return lambda wildcards: as_settings(**found(wildcards).settings)


def outputs_of(stage):
    """A stage's named outputs, those that people look at marked for `snakemake --report`."""
    return {
        name: shown(paths) if isinstance(paths, str) else list(map(shown, paths))
        for name, paths in first_job(stage).outputs.items()
    }


def part_of(stage):
    """What tells a stage's jobs apart, in the names of its logs."""
    return "/".join(f"{{{name}}}" for name in first_job(stage).wildcards) or "all"


def everything(workflow):
    """All files of the study: one that went missing is made again, though what was made from it is still there."""
    return sorted({path for jobs in JOBS.values() for job in jobs.values() for path in paths_of(job.made())})


for _stage in JOBS:

    rule:
        name:
            _stage
        input:
            unpack(inputs_of(_stage)),
        output:
            **outputs_of(_stage),
        log:
            log_of(_stage, part_of(_stage)),
        benchmark:
            benchmark_of(_stage, part_of(_stage))
        wildcard_constraints:
            **{name: "|".join(sorted({re.escape(dict(key)[name]) for key in JOBS[_stage]})) for name in first_job(_stage).wildcards},
        retries: RETRIES.get(_stage, 0)
        threads: first_job(_stage).threads
        resources:
            **RESOURCES.get(_stage, {}),
        params:
            code=code(_stage),
            files=files,
            settings=settings_of(_stage),
        shell:
            run_stage("{rule}")  # by its name: a loop's variable is read when the job runs, and is the last stage then
