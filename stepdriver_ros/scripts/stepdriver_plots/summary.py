"""A recorded motion in one sentence."""


def summary(curve):
    """How far, how long and how fast an axis moved."""
    times, stands, unit = curve.position()[0], curve.stands, curve.unit
    fastest = max((abs(speed) for speed in curve.speed()[1]), default=0.0)
    rate = f" ({fastest / curve.step:,.0f} steps/s)" if curve.step and unit != "steps" else ""
    return (f"{curve.label}: {len(times):,} {curve.samples} in {times[-1] - times[0]:.3g} s, "
            f"from {stands[0]:.6g} to {stands[-1]:.6g} {unit} "
            f"(least {min(stands):.6g}, greatest {max(stands):.6g} {unit}), "
            f"at most {fastest:.4g} {unit}/s{rate}")
