# Grasps by a robot: objects in several positions, pressed at the events of each grasp, read by the virtual sensor; one event by several models.

RESOURCES = {
    "grasp": {"mem_mb": 3000, "runtime": 120},  # four presses, at 50 N of the hyperelastic model some minutes each
    "one_event": {"mem_mb": 3000, "runtime": 60},
    "draw_grasped_objects": {"mem_mb": 2000, "runtime": 30},
}
RETRIES = {"draw_grasped_objects": 1}  # its pictures are drawn in a process beside, which a graphics driver can end


include: "jobs.smk"
