# What decides the paper's claims: truths of other laws, generated objects, all contestants and readouts, tests over objects.

RESOURCES = {
    "press": {"mem_mb": lambda wildcards, attempt: 4000 * attempt, "runtime": 120},
    "press_fast": {"mem_mb": 3000, "runtime": 60},
    "match_stiffness": {"mem_mb": 3000, "runtime": 60},
    "learn": {"mem_mb": 6000, "runtime": 600},
    "trace_curve": {"mem_mb": 3000, "runtime": 600},
}
RETRIES = {}


include: "jobs.smk"
