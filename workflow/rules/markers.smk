# Marker images: presses of a gel with a camera along the paper's paths, networks that learn its images, scores and claims.

RESOURCES = {
    "press_object": {"mem_mb": 3000, "runtime": 240},
    "press_baseline": {"mem_mb": 3000, "runtime": 240},
    "train_network": {"mem_mb": 6000, "runtime": 600},
    "score_network": {"mem_mb": 3000, "runtime": 120},
    "score_references": {"mem_mb": 3000, "runtime": 120},
}
RETRIES = {}


include: "jobs.smk"
