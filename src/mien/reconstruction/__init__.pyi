"""The public names of `mien.reconstruction`: this is their only list; `mien.lazy` reads it."""

from mien.assets.generic import GenericHead as GenericHead
from mien.assets.generic import load_generic_head as load_generic_head
from mien.head import Expression as Expression
from mien.head import FittedView as FittedView
from mien.pipelines.build import Build as Build
from mien.pipelines.build import BuildOptions as BuildOptions
from mien.pipelines.build import build_head as build_head
from mien.pipelines.build import build_head_folder as build_head_folder
from mien.reconstruction.fit import fit_views as fit_views
from mien.reconstruction.landmark_fit import FitOptions as FitOptions
from mien.reconstruction.result import ExpressionFit as ExpressionFit
from mien.reconstruction.result import Fit as Fit
from mien.reconstruction.result import NeutralFit as NeutralFit
