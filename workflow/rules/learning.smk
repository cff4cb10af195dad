# Data sets -> search -> one network per tested model -> how well it reads what it never saw.

SPLITS = ("train", "validation", "unseen", "grasps")


def dataset(split, models=STUDY.tested):
    """A split's files, one per model, by default of those under test."""
    return [f"{RESULTS}/dataset/{model}/{split}.nc" for model in models]


# The network that a study's own is compared with, on the same split.
BESIDE = "printed" if STUDY.values.network.architecture == "compact" else "compact"


def learned(name):
    """A file of each trained network: the study's own of each model, then those beside it."""
    return [f"{RESULTS}/learning/{model}/{part}{name}" for part in ("", f"{BESIDE}/") for model in STUDY.tested]


CURVE = STUDY.values.learning_curve
CURVES = [f"{RESULTS}/learning/{model}/learning_curve.csv" for model in STUDY.learnt_from] if CURVE.shares else []


SEEDS = [f"{RESULTS}/learning/{model}/seeds.csv" for model in STUDY.tested] if STUDY.values.learning.seeds > 1 else []


def curve_networks(model):
    """The networks of a model's learning curve; the reference has no search, so its maps meet the compact one only."""
    return CURVE.networks if model in STUDY.tested else ("compact",)


def curve_files(wildcards):
    """What the search and the trial of rates found, where a network of the learning curve needs it."""
    return found_files(wildcards, curve_networks(wildcards.model))


def found_files(wildcards, networks):
    """The same for any networks."""
    searched = {"best": f"{RESULTS}/learning/{wildcards.model}/best.json"} if "searched" in networks else {}
    return searched | (rate_file("printed") if "printed" in networks else {})


def rate_file(architecture):
    """The learning rate that was found for a network itself, as an input of its training; the searched one has the search's."""
    found = architecture == "printed" and STUDY.values.training.learning_rate == "found"
    return {"rate": f"{RESULTS}/learning/{{model}}/rate.json"} if found else {}


OWN = STUDY.values.network.architecture


rule build_dataset:
    input:
        **samples_of(),
    output:
        **{split: dataset(split, STUDY.learnt_from) for split in SPLITS},
        manifest=f"{RESULTS}/dataset/manifest.csv",
    log:
        log_of("build_dataset"),
    benchmark:
        benchmark_of("build_dataset")
    params:
        code=code("build_dataset"),
        files=files,
        settings=as_settings(
            models=STUDY.learnt_from,
            **({} if STUDY.archive else {"items": [{"set": item.set, "item": item.id} for item in STUDY.items()]}),
            **plain(STUDY.values.dataset),
            seed=STUDY.values.seed,
        ),
    shell:
        run_stage("build_dataset")


rule search_hyperparameters:
    input:
        train=f"{RESULTS}/dataset/{{model}}/train.nc",
        validation=f"{RESULTS}/dataset/{{model}}/validation.nc",
    output:
        search=f"{RESULTS}/learning/{{model}}/search.csv",
        best=f"{RESULTS}/learning/{{model}}/best.json",
    log:
        log_of("search_hyperparameters", "{model}"),
    benchmark:
        benchmark_of("search_hyperparameters", "{model}")
    threads: STUDY.values.training.threads
    resources:
        mem_mb=lambda wildcards, attempt: 4000 * attempt,
        runtime=720,
    params:
        code=code("search_hyperparameters"),
        files=files,
        settings=as_settings(
            search=plain(STUDY.values.search),
            network=plain(STUDY.values.network),
            ssim=plain(STUDY.values.ssim),
            device=STUDY.values.training.device,
            seed=STUDY.values.seed,
            threads=STUDY.values.training.threads,  # of sums, on however few cores: the results depend on it
        ),
    shell:
        run_stage("search_hyperparameters")


rule find_learning_rate:
    input:
        train=f"{RESULTS}/dataset/{{model}}/train.nc",
        validation=f"{RESULTS}/dataset/{{model}}/validation.nc",
    output:
        rates=f"{RESULTS}/learning/{{model}}/rates.csv",
        rate=f"{RESULTS}/learning/{{model}}/rate.json",
    log:
        log_of("find_learning_rate", "{model}"),
    benchmark:
        benchmark_of("find_learning_rate", "{model}")
    threads: STUDY.values.training.threads
    params:
        code=code("find_learning_rate"),
        files=files,
        settings=as_settings(
            training=STUDY.values.training.model_dump(mode="json", exclude={"threads", "epochs", "patience", "learning_rate"}),
            network=plain(STUDY.values.network),
            ssim=plain(STUDY.values.ssim),
            seed=STUDY.values.seed,
            threads=STUDY.values.training.threads,
        ),
    shell:
        run_stage("find_learning_rate")


rule train_cnn:
    input:
        **rate_file(OWN),
        train=f"{RESULTS}/dataset/{{model}}/train.nc",
        validation=f"{RESULTS}/dataset/{{model}}/validation.nc",
        best=f"{RESULTS}/learning/{{model}}/best.json",
    output:
        model=f"{RESULTS}/learning/{{model}}/model.pt",
        history=f"{RESULTS}/learning/{{model}}/history.csv",
        timing=f"{RESULTS}/learning/{{model}}/timing.csv",
    log:
        log_of("train_cnn", "{model}"),
    benchmark:
        benchmark_of("train_cnn", "{model}")
    threads: STUDY.values.training.threads
    resources:
        mem_mb=lambda wildcards, attempt: 4000 * attempt,
        runtime=720,
    params:
        code=code("train_cnn"),
        files=files,
        settings=as_settings(
            training=STUDY.values.training.model_dump(mode="json", exclude={"threads"}),
            network=plain(STUDY.values.network),
            ssim=plain(STUDY.values.ssim),
            seed=STUDY.values.seed,
            threads=STUDY.values.training.threads,
        ),
    shell:
        run_stage("train_cnn")


rule train_beside:
    input:
        **rate_file(BESIDE),
        train=f"{RESULTS}/dataset/{{model}}/train.nc",
        validation=f"{RESULTS}/dataset/{{model}}/validation.nc",
        best=f"{RESULTS}/learning/{{model}}/best.json",
    output:
        model=f"{RESULTS}/learning/{{model}}/{BESIDE}/model.pt",
        history=f"{RESULTS}/learning/{{model}}/{BESIDE}/history.csv",
        timing=f"{RESULTS}/learning/{{model}}/{BESIDE}/timing.csv",
    log:
        log_of("train_beside", "{model}"),
    benchmark:
        benchmark_of("train_beside", "{model}")
    threads: STUDY.values.training.threads
    resources:
        mem_mb=lambda wildcards, attempt: 4000 * attempt,
        runtime=720,
    params:
        code=code("train_cnn"),
        files=files,
        settings=as_settings(
            training=STUDY.values.training.model_dump(mode="json", exclude={"threads"}),
            network=plain(STUDY.values.network) | {"architecture": BESIDE},
            ssim=plain(STUDY.values.ssim),
            seed=STUDY.values.seed,
            threads=STUDY.values.training.threads,
        ),
    shell:
        run_stage("train_cnn")


rule evaluate:
    input:
        **({} if STUDY.archive else {"presses": presses(STUDY.tested)}),
        networks=[f"{RESULTS}/learning/{model}/model.pt" for model in STUDY.tested],
        validation=dataset("validation"),
        unseen=dataset("unseen"),
        grasps=dataset("grasps"),
    output:
        ssim=f"{RESULTS}/evaluation/ssim.csv",
        per_item=f"{RESULTS}/evaluation/items.csv",
        summary=f"{RESULTS}/evaluation/summary.csv",
        ceiling=f"{RESULTS}/evaluation/ceiling.csv",
        timing=f"{RESULTS}/evaluation/timing.csv",
        predictions=f"{RESULTS}/evaluation/predictions.nc",
    log:
        log_of("evaluate"),
    benchmark:
        benchmark_of("evaluate")
    params:
        code=code("evaluate"),
        files=files,
        settings=as_settings(ssim=plain(STUDY.values.ssim), seed=STUDY.values.seed),
    shell:
        run_stage("evaluate")


rule score_baselines:
    input:
        **{split: dataset(split) for split in SPLITS},
    output:
        baselines=f"{RESULTS}/evaluation/baselines.csv",
        taxels=f"{RESULTS}/evaluation/taxels.csv",
    log:
        log_of("score_baselines"),
    benchmark:
        benchmark_of("score_baselines")
    params:
        code=code("score_baselines"),
        files=files,
        settings=as_settings(
            sensor=STUDY.sensor,
            counts_per_relative_change=STUDY.counts_per_relative_change,
            ssim=plain(STUDY.values.ssim),
        ),
    shell:
        run_stage("score_baselines")


rule compare_networks:
    input:
        networks=learned("model.pt"),
        timings=learned("timing.csv"),
        histories=learned("history.csv"),
        baselines=rules.score_baselines.output.baselines,
        ceiling=rules.evaluate.output.ceiling,
        validation=dataset("validation"),
        unseen=dataset("unseen"),
        grasps=dataset("grasps"),
    output:
        networks=shown(f"{RESULTS}/tables/networks.csv"),
        scores=shown(f"{RESULTS}/tables/scores.csv"),
        levels=shown(f"{RESULTS}/tables/levels.csv"),
        verdicts=f"{RESULTS}/evaluation/verdicts.json",
    log:
        log_of("compare_networks"),
    benchmark:
        benchmark_of("compare_networks")
    params:
        code=code("compare_networks"),
        files=files,
        settings=as_settings(architecture=OWN, ssim=plain(STUDY.values.ssim), seed=STUDY.values.seed),
    shell:
        run_stage("compare_networks")


rule learning_curve:
    input:
        unpack(curve_files),
        **{split: f"{RESULTS}/dataset/{{model}}/{split}.nc" for split in SPLITS},
    output:
        curve=f"{RESULTS}/learning/{{model}}/learning_curve.csv",
    log:
        log_of("learning_curve", "{model}"),
    benchmark:
        benchmark_of("learning_curve", "{model}")
    threads: STUDY.values.training.threads
    resources:
        mem_mb=lambda wildcards, attempt: 4000 * attempt,
        runtime=720,
    params:
        code=code("learning_curve"),
        files=files,
        settings=lambda w: as_settings(
            learning_curve=plain(CURVE) | {"networks": curve_networks(w.model)},
            training=STUDY.values.training.model_dump(mode="json", exclude={"threads"}),
            network=plain(STUDY.values.network),
            ssim=plain(STUDY.values.ssim),
            seed=STUDY.values.seed,
            threads=STUDY.values.training.threads,
        ),
    shell:
        run_stage("learning_curve")


rule repeat_learning:
    input:
        unpack(lambda wildcards: found_files(wildcards, STUDY.values.learning.networks)),
        **{split: f"{RESULTS}/dataset/{{model}}/{split}.nc" for split in SPLITS},
    output:
        seeds=f"{RESULTS}/learning/{{model}}/seeds.csv",
    log:
        log_of("repeat_learning", "{model}"),
    benchmark:
        benchmark_of("repeat_learning", "{model}")
    threads: STUDY.values.training.threads
    resources:
        mem_mb=lambda wildcards, attempt: 4000 * attempt,
        runtime=720,
    params:
        code=code("repeat_learning"),
        files=files,
        settings=as_settings(
            repeats=plain(STUDY.values.learning),
            training=STUDY.values.training.model_dump(mode="json", exclude={"threads"}),
            network=plain(STUDY.values.network),
            ssim=plain(STUDY.values.ssim),
            seed=STUDY.values.seed,
            threads=STUDY.values.training.threads,
        ),
    shell:
        run_stage("repeat_learning")


if SEEDS:

    rule gather_seeds:
        input:
            seeds=SEEDS,
        output:
            table=shown(f"{RESULTS}/tables/seeds.csv"),
        log:
            log_of("gather_seeds"),
        benchmark:
            benchmark_of("gather_seeds")
        params:
            code=code("gather_seeds"),
            files=files,
            settings=as_settings(),
        shell:
            run_stage("gather_seeds")


if CURVES:

    rule find_limits:
        input:
            curves=CURVES,
            networks=rules.compare_networks.output.networks,
        output:
            limits=shown(f"{RESULTS}/tables/limits.csv"),
        log:
            log_of("find_limits"),
        benchmark:
            benchmark_of("find_limits")
        params:
            code=code("find_limits"),
            files=files,
            settings=as_settings(
                architecture=STUDY.values.network.architecture,
                tested=STUDY.tested,
                reference=STUDY.values.reference,
                source=STUDY.source,
            ),
        shell:
            run_stage("find_limits")


if STUDY.virtual:

    rule compare_gains:
        input:
            references=[f"{RESULTS}/presses/grasps/{item}/{STUDY.values.reference}.nc" for item in STUDY.items_of["grasps"]],
            presses=[f"{RESULTS}/presses/grasps/{item}/{model}.nc" for model in STUDY.tested for item in STUDY.items_of["grasps"]],
        output:
            gains=shown(f"{RESULTS}/tables/gains.csv"),
        log:
            log_of("compare_gains"),
        benchmark:
            benchmark_of("compare_gains")
        params:
            code=code("compare_gains"),
            files=files,
            settings=as_settings(
                sensor=STUDY.sensor,
                virtual_sensor=STUDY.values.virtual_sensor,
                ssim=plain(STUDY.values.ssim),
                seed=STUDY.values.seed,
            ),
        shell:
            run_stage("compare_gains")
