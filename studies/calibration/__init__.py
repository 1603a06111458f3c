"""Are the probabilities of the closed loop to be bet on, and do its intervals hold? The six scores, and their fit.

    python studies/calibration/run.py FOLDER --seed 1 --size 150 [--jobs 2]    campaigns, closed one by one; goes on
    python studies/calibration/fit.py FOLDER                                   temperature and priors by kind
    PYTHONPATH=CHECKOUT/src python studies/calibration/former.py FOLDER        the same by an earlier version
    python studies/calibration/nested.py FOLDER --seed 8002 --campaigns 20 --out results/nested    evidence, two ways
    python studies/calibration/score.py FOLDER --out results/calibration       the scores, with their intervals

The seed of the run that judges is named in a commit before it: 717, of 150 campaigns a family. All campaigns are
synthetic. Two simulators that share no code with armid make them: `studies/stand` an arm, `studies/machines` eight
other machines. Read `campaigns`, `run`, `former`, `truth`, `scores`, `score`, `fit`, `nested`.
"""
