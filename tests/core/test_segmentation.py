"""The inference engines as the process sees them; what they compute is tested with the pipeline and the models."""

import subprocess
import sys

TWO_MODELS = """
import gc, os, signal
import numpy as np
from core.config import SegmentationConfig
from core.perception.segmentation import open_segmenter

config = SegmentationConfig(device="openvino", threads=1)
first, second = open_segmenter(config), open_segmenter(config)
for segment in (first, second):
    segment(np.zeros((64, 64, 3), np.uint8))
del segment, first
gc.collect()
del second
gc.collect()
signal.signal(signal.SIGTERM, lambda *_: print("heard"))
os.kill(os.getpid(), signal.SIGTERM)
"""


def test_a_signal_is_survived_when_models_were_opened_and_dropped() -> None:
    """OpenVINO's stack for signals is unmapped when a second one gives it back: Ctrl-C after a change of the model killed us."""
    done = subprocess.run([sys.executable, "-c", TWO_MODELS], capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stdout) == (0, "heard\n"), done.stderr
