"""The public names of `mien.rig`: this is their only list; `mien.lazy` reads it."""

from mien.rig.regions import check_masks as check_masks
from mien.rig.regions import default_masks as default_masks
from mien.rig.rig import Rig as Rig
from mien.rig.state import FaceState as FaceState
from mien.rig.state import Gaze as Gaze
from mien.rig.state import PosedFace as PosedFace
