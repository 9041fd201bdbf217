#!/usr/bin/env python3
"""Two trajectories against one reference: a table of their errors.

usage: evaluate_trajectories.py REFERENCE ESTIMATE ESTIMATE
"""
import sys

import tutti


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    reference, *estimates = sys.argv[1:]
    rows = {}
    for estimate in estimates:
        # one camera has no scale of its own: alignment="sim3"
        result = tutti.evaluate(reference, estimate, alignment="se3", rpe_delta=1, rpe_unit="frames")
        rows[estimate] = {"ATE [m]": result["ate"]["rmse"], "worst [m]": result["ate"]["max"],
                          "rotation [deg]": result["ate_rotation_deg"]["rmse"],
                          "RPE [m]": result["rpe"]["translation"]["rmse"], "drift [%]": result["drift"]["t_rel_percent"]}
    # pandas.DataFrame.from_dict(rows, orient="index") is the same table
    print(f"{'':40}" + "".join(f"{column:>16}" for column in next(iter(rows.values()))))
    for estimate, row in rows.items():
        print(f"{estimate[-40:]:40}" + "".join(f"{value:16.4f}" for value in row.values()))


if __name__ == "__main__":
    main()
