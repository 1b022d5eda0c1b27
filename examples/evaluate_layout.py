"""The load that a layout takes off, by gas dynamics, under charges drawn from the site."""

import blast_env

scenario = blast_env.load_scenario("visitor_entrance")
# Cells of 0.5 m are quick; without `cell_m`, the cells of a final statement take ten times as long.
walls = [(7, 8, "t_wall_3_6", True), (14, 7, "t_wall_3_6", True)]  # row, column, item, turned
found = blast_env.evaluate_layout(scenario, walls, seeds=range(3), cell_m=0.5)

low, high = found.ci95
print(f"reduction {found.mean_reduction:.1%}, 95 % interval {low:.1%} to {high:.1%}")
print(found.table[["structure", "impulse_pa_s", "unprotected_impulse_pa_s"]].to_string())
blast_env.write_layout("walls.json", scenario, walls)
