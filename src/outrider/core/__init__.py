"""Numbers only: functions of floats and arrays; no classes, no files, no random state.

`angles` (SO(2)), `rotations` (SO(3), one at a time), `attitudes` (arrays of rotations), `se2`, `se3`, `manifold` (state
vectors with angles and quaternions in them), `linalg`, `frames` (NED, FRD, w x y z and ours), `geodesy` (WGS84),
`magnetism` (the Earth's field), `sampling` (correlated noise), `solids` (signed distances in space), `flat` (in the
plane: polygons, grids, upright columns), `rays` (what a beam meets in them).
"""
