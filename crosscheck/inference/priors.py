"""The numbers that steer a diagnosis, each with its meaning and where it comes from.

Nothing else decides what a diagnosis names. What makes data unfit, what remainder matters and what
``add`` refuses have thresholds of their own, beside their code. ``scripts/score.py --move`` says
what moving one by a factor of two does. What stands elsewhere are tolerances of the arithmetic and
limits of effort.
"""

from __future__ import annotations

# --- what is believed before any data -------------------------------------------------------------

UNKNOWN = -5.0
"""ln prior of something that the catalogue lacks, shared among the kinds of fields. About one robot
in 150: of the diagnoses of real effects, none lost its name to a field at these odds."""

ANEW = -2.0
"""ln prior of an effect with other values in each file or run over the same with common ones. One
in seven: robots are homed and trackers set up anew between files, but most errors stay."""

STATED, MISJUDGED, MISJUDGED_BY = 0.35, 0.1, 1.5
"""Standard deviation of ln(noise/stated noise), a factor of 1.4 (contracts, third edition); chance
that a stated value was misjudged, and the standard deviation then, a factor of 4.5. A scatter
within dwells is a lower bound: there, noise above it is always of this second kind."""

UNSTATED = 3.0
"""The same standard deviation where noise was not stated and a rough estimate stands in for it."""

OUTLIERS, FAR = (0.95, 0.045, 0.005), (1.0, 10.0, 100.0)
"""Chances that the readings of a row are usual, off, or far off; how many times the noise these
are. One reading in twenty is disturbed on real trackers (reflections, lost lines of sight)."""

WIDTHS = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
"""Prior standard deviations of an effect's values in expected sizes, all equally probable. A good
tracker resolves a hundredth of an expected size; expected sizes may be wrong by ten. Data that
would show no effect even at the widest allow no verdict."""

FIELD_WIDTHS = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
"""The same for fields, in units of the noise: below 0.3 they do not show, above 100 they are seen
whatever the prior."""

LARGEST = 5.0 * WIDTHS[-1]
"""No effect of more expected sizes is listed as found: five standard deviations of the widest
prior. The lines of one real robot were truly 20 expected sizes longer than stated."""

# --- error rates and costs ------------------------------------------------------------------------

SURE = 0.95
"""Probability from which on an effect is named, or something unknown said to be there."""

FALSE_ALARM = 0.01
"""p-value below which an effect that a user adds explains more than chance does; and chance that
an effect is missing instead of all that are named as indistinguishable, if a few more do it."""

OPEN = 1.0
"""Expected number of effects that are left open (sum of min(P, 1 - P)) below which a few named
effects are the whole answer."""

MAY_BE_UNKNOWN = 0.25
"""Probability of something unknown from which on no name is given beside it, because the named
effects may imitate it."""

FEW = 5
"""More effects than this at once are no diagnosis but a calibration: nobody checks six by hand."""

EQUAL = 3.0
"""ln evidence (odds of twenty to one, as SURE) that exchanging two effects may cost if these data
cannot tell them apart; per further parameter of a small effect that does all that a smaller one
does."""

SLOW = 0.9
"""Noise that is larger than stated was misjudged while its correlation from row to row is below
this, as that of trackers is (0.85 at most of those looked at). What decays by half in seven rows or
more, a third of a run, belongs to the run and not to the sensor: it is something unknown."""

MISJUDGED_MOST = 10.0
"""Nobody misjudges a noise by more than this: if the part of it that the row before foretells is
larger, it is something unknown. Scatters within dwells that were taken for accuracies were 3 to 6
times too small. White noise foretells nothing, and is never unknown."""

COMPARABLE = 0.5
"""A field that explains this part of what the best one does may be the true one as well: an effect
is named beside something unknown only if it is needed beside each of these."""

LEFTOVER = 0.1
"""Part of what an unknown effect does that the field leaves which follows it best, three times the
median of the lenses and flexing platforms that were looked at. Known effects may imitate it."""

NUMBERS = 6
"""Beside something unknown no effect of more numbers than a pose has is named: sixteen numbers of
drums follow a bent cable as well as a field does."""

LIMITED = 360
"""With fewer readings (60 whole poses) whose noise was not stated, correlated noise and structure
look alike, unless effects divide the error by MOST_OF_IT."""

MOST_OF_IT = 3.0
"""See LIMITED: what removes two thirds of an error is no noise."""

# --- how long to search ---------------------------------------------------------------------------

WITHIN = 12.0
"""Hypotheses that the linear model considers worse by more ln evidence are not fitted: after a fit
they were never off by more where cables stay taut, and odds of e^-12 change no word."""
