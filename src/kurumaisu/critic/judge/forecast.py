# SPDX-License-Identifier: BSD-3-Clause
"""Which model, noise and doubt predict the motion, by the verdict."""

from __future__ import annotations

from kurumaisu.critic.judge.decide import Decision
from kurumaisu.critic.noise.base_noise import Noise
from kurumaisu.critic.predict.motion import Forecast
from kurumaisu.critic.predict.parameter_doubt import about_curve, about_fit
from kurumaisu.critic.values.settings import Settings


def forecast_of(made: Decision, settings: Settings, baseline: Noise) -> Forecast:
    """Return what predicts motion: what extends the model by the verdict; without that the model in its own noise.

    settings: of the criticism; baseline: noise about the model as it was.
    """
    problem, best, extension = made.problem, made.found.best, made.extension
    given = {setting.id for setting in settings}
    if extension is not None and extension.curve.id in given:
        return Forecast(problem.model, extension.settings, problem.noise, about_curve(extension))
    if best.ids and best.ids <= given:
        return Forecast(problem.model, best.settings, problem.noise, about_fit(problem, best))
    return Forecast(problem.model, (), baseline)
