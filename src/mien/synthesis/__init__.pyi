"""The public names of `mien.synthesis`: this is their only list; `mien.lazy` reads it."""

from mien.assets.feature_points import FeatureLayout as FeatureLayout
from mien.assets.feature_points import load_feature_layout as load_feature_layout
from mien.assets.subregions import Subregions as Subregions
from mien.assets.subregions import default_subregions as default_subregions
from mien.io.examples.example_folder import load_examples as load_examples
from mien.io.examples.example_folder import save_examples as save_examples
from mien.pipelines.examples import ExampleRequest as ExampleRequest
from mien.pipelines.examples import GatheredExamples as GatheredExamples
from mien.pipelines.examples import gather_examples as gather_examples
from mien.pipelines.examples import save_example_folder as save_example_folder
from mien.pipelines.synthesize import SynthesizedPicture as SynthesizedPicture
from mien.pipelines.synthesize import synthesize_expression as synthesize_expression
from mien.pipelines.synthesize_head import HeadView as HeadView
from mien.pipelines.synthesize_head import SynthesizedHeadPicture as SynthesizedHeadPicture
from mien.pipelines.synthesize_head import synthesize_head as synthesize_head
from mien.synthesis.examples.example_set import Example as Example
from mien.synthesis.examples.example_set import ExampleSet as ExampleSet
from mien.synthesis.heads.synthesizer import HeadSynthesis as HeadSynthesis
from mien.synthesis.heads.synthesizer import HeadSynthesizer as HeadSynthesizer
from mien.synthesis.synthesizer import Synthesis as Synthesis
from mien.synthesis.synthesizer import SynthesisOptions as SynthesisOptions
from mien.synthesis.synthesizer import Synthesizer as Synthesizer
