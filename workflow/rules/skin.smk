# A robot skin: readings under loads, elastomer and thickness, maps, modules on a link, the papers' claims.

RESOURCES = {
    "press_object": {"mem_mb": 6000, "runtime": 120},  # at finite strains: six modules have 200,000 unknowns
    "read_taxels": {"mem_mb": 4000, "runtime": 60},
    "map_patch": {"mem_mb": 4000, "runtime": 60},
    "search_cell": {"mem_mb": 2000, "runtime": 60},
    "choose_layer": {"mem_mb": 2000, "runtime": 60},
    "judge_claims": {"mem_mb": 4000, "runtime": 60},
}
RETRIES = {}


include: "jobs.smk"
