"""What the tables and figures of a study of loops show and how they were computed."""

BLIND = (
    "Each loop saw its campaign alone; the key that holds the truth was opened for this report, by nothing before it."
)
TARGETS = "What the closed loop was to reach on undeclared effects, and what it reached."
TWO = (
    "Both right: each truth has its own name, or a group of at most 4 of its own that holds it, and nothing else is "
    "named."
)
UNLISTED = "The arm has an effect that no library holds: a name may explain a part, but not be said to explain all."
ONE_STROKE = "One lowering stroke, with one effect at its middle size or none: what can be known there is little."
VERDICTS = "Campaigns by verdict and by what was added to the declared model."
CONFUSION = (
    "Single effects, a row each: campaigns by what was answered; the colour is the share of the row. Left: campaigns "
    "in which the effect moves the held-out error of the best declared model by more than 20 % of its noise; right: "
    "the others, on which the best answer may be silence. Named first of a group: the truth is named, with others that "
    "cannot be told from it. Held by a group: another is named, and the truth among those that cannot be told from it."
)
NAMED = (
    "Single effects and controls, a row each, by what was named first: an effect, a term without a name at a port, or "
    "nothing. The frame marks the true name; beside it stand groups' first names too."
)
ANSWERS = "Campaigns of each class by their judgement; the number of campaigns stands behind the name."
ALARMS = "Share of the campaigns without any effect on which something was found, with its 95 % Wilson interval."
HELD_OUT = (
    "RMSE on the records held out over the noise that is really in them, before and after the loop, one pair of marks "
    "a campaign; the dashed line is what is aimed at."
)
BIAS = (
    "Size of the relative errors of the parameters before and after the loop, campaigns of one or two listed effects: "
    "the box spans the quartiles, the thick line is the median, the whiskers reach from the 5th to the 95th "
    "percentile. Errors below 0.001 % are drawn there."
)
GROUPS = (
    "Left: campaigns of listed effects by the size of the group that was named. Right: share of the campaigns that "
    "were closed within so many seconds; the dashed line is at 30 s."
)
