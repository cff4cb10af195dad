# Data sets -> search -> one network per tested model -> how well it reads what it never saw.

SPLITS = ("train", "validation", "unseen", "grasps")


rule build_dataset:
    input:
        code=code("build_dataset"),
        presses=lambda w: presses(w.model),
        tactile=[f"{RESULTS}/tactile/{item.set}/{item.id}.nc" for item in STUDY.items()],
    output:
        **{split: f"{RESULTS}/dataset/{{model}}/{split}.nc" for split in SPLITS},
        manifest=f"{RESULTS}/dataset/{{model}}/manifest.csv",
    params:
        files=files,
        settings=lambda w: as_settings(
            model=w.model,
            items=[{"set": item.set, "item": item.id} for item in STUDY.items()],
            split=STUDY.values.dataset.train_fraction,
            seed=STUDY.values.seed,
        ),
    log:
        log_of("build_dataset", "{model}"),
    benchmark:
        benchmark_of("build_dataset", "{model}")
    shell:
        run_stage("build_dataset")


rule search_hyperparameters:
    input:
        code=code("search_hyperparameters"),
        train=f"{RESULTS}/dataset/{{model}}/train.nc",
        validation=f"{RESULTS}/dataset/{{model}}/validation.nc",
    output:
        search=f"{RESULTS}/learning/{{model}}/search.csv",
        best=f"{RESULTS}/learning/{{model}}/best.json",
    params:
        files=files,
        settings=as_settings(search=STUDY.values.search.plain(), seed=STUDY.values.seed),
    threads: STUDY.values.training.threads
    log:
        log_of("search_hyperparameters", "{model}"),
    benchmark:
        benchmark_of("search_hyperparameters", "{model}")
    shell:
        run_stage("search_hyperparameters")


rule train_cnn:
    input:
        code=code("train_cnn"),
        train=f"{RESULTS}/dataset/{{model}}/train.nc",
        validation=f"{RESULTS}/dataset/{{model}}/validation.nc",
        best=f"{RESULTS}/learning/{{model}}/best.json",
    output:
        model=f"{RESULTS}/learning/{{model}}/model.pt",
        history=f"{RESULTS}/learning/{{model}}/history.csv",
    params:
        files=files,
        settings=as_settings(
            training=STUDY.values.training.plain(),
            network=STUDY.values.network.plain(),
            seed=STUDY.values.seed,
        ),
    threads: STUDY.values.training.threads
    log:
        log_of("train_cnn", "{model}"),
    benchmark:
        benchmark_of("train_cnn", "{model}")
    shell:
        run_stage("train_cnn")


rule evaluate:
    input:
        code=code("evaluate"),
        networks=[f"{RESULTS}/learning/{model}/model.pt" for model in STUDY.values.tested],
        unseen=[f"{RESULTS}/dataset/{model}/unseen.nc" for model in STUDY.values.tested],
        grasps=[f"{RESULTS}/dataset/{model}/grasps.nc" for model in STUDY.values.tested],
        validation=[f"{RESULTS}/dataset/{model}/validation.nc" for model in STUDY.values.tested],
        presses=[path for model in STUDY.values.tested for path in presses(model)],
    output:
        ssim=f"{RESULTS}/evaluation/ssim.csv",
        timing=f"{RESULTS}/evaluation/timing.csv",
        predictions=f"{RESULTS}/evaluation/predictions.nc",
    params:
        files=files,
        settings=as_settings(ssim=STUDY.values.ssim.plain(), models=STUDY.values.tested),
    log:
        log_of("evaluate"),
    benchmark:
        benchmark_of("evaluate")
    shell:
        run_stage("evaluate")
