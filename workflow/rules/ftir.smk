# The dielectric pressed on glass: contact area against force, by mechanics and from an image.


rule press_on_glass:
    input:
        card=card_of("dielectric"),
    output:
        state=f"{RESULTS}/ftir/contact_state.nc",
        virtual=f"{RESULTS}/ftir/virtual_dielectric.nc",
    log:
        log_of("press_on_glass"),
    benchmark:
        benchmark_of("press_on_glass")
    resources:
        mem_mb=lambda wildcards, attempt: 3000 * attempt,
        runtime=60,
    params:
        code=code("press_on_glass"),
        files=files,
        settings=as_settings(
            sensor=STUDY.sensor,
            **{key: value for key, value in plain(STUDY.values.ftir).items() if key not in ("camera", "measured")},
            seed=STUDY.values.seed,
        ),
    shell:
        run_stage("press_on_glass")


rule detect_discs:
    input:
        states=[rules.press_on_glass.output.virtual],
    output:
        images=directory(f"{RESULTS}/ftir/images"),
        discs=f"{RESULTS}/ftir/discs.csv",
    log:
        log_of("detect_discs"),
    benchmark:
        benchmark_of("detect_discs")
    params:
        code=code("detect_discs"),
        files=files,
        settings=as_settings(camera=plain(STUDY.values.ftir.camera), seed=STUDY.values.seed),
    shell:
        run_stage("detect_discs")


rule validate_ftir:
    input:
        **({"measured": STUDY.values.ftir.measured} if STUDY.values.ftir.measured else {}),
        state=rules.press_on_glass.output.state,
        virtual=rules.press_on_glass.output.virtual,
        discs=[rules.detect_discs.output.discs],
    output:
        area=f"{RESULTS}/ftir/contact_area.csv",
        orientations=f"{RESULTS}/ftir/orientations.csv",
        summary=f"{RESULTS}/ftir/summary.json",
    log:
        log_of("validate_ftir"),
    benchmark:
        benchmark_of("validate_ftir")
    params:
        code=code("validate_ftir"),
        files=files,
        settings=as_settings(pixel_mm=STUDY.values.ftir.camera.pixel_mm),
    shell:
        run_stage("validate_ftir")
