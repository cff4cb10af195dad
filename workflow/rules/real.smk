# Gels with a camera on measured data: force of a ball, markers, shading.

RESOURCES = {
    "press_ball": {"mem_mb": 1500, "runtime": 30},
    "fit_shading": {"mem_mb": 4000, "runtime": 60},
    "gather_presses": {"mem_mb": 2000, "runtime": 30},
}
RETRIES = {}


include: "jobs.smk"
