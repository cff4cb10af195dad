# A palpation sensor: sweeps of the jaw over each tissue, on two meshes and under other assumptions, hardness, hidden lumps.

RESOURCES = {
    "sweep": {"mem_mb": 2000, "runtime": 60},
    "measure_hardness": {"mem_mb": 2000, "runtime": 60},
    "solve_lumps": {"mem_mb": 2000, "runtime": 240},
    "find_lumps": {"mem_mb": 2000, "runtime": 240},
}
RETRIES = {}


include: "jobs.smk"
