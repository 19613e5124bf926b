"""Finds the poses of photos with pycolmap 4, for "litetex capture".

Arguments: a step (features, matching or mapping), and a JSON file that describes the work.
"""

import json
import os
import sys
import threading

import pycolmap


def leave_with_parent():
    """Ends this process when the one that started it does."""
    os.read(0, 1)
    os._exit(3)


with open(sys.argv[2], encoding="utf-8") as file:
    job = json.load(file)
if job["leaves_with_parent"]:
    threading.Thread(target=leave_with_parent, daemon=True).start()

if sys.argv[1] == "features":
    options = pycolmap.FeatureExtractionOptions()
    options.max_image_size = job["side_max_px"]
    options.num_threads = job["threads"]
    options.sift.max_num_features = job["features_max"]
    for camera in job["cameras"]:
        reader = pycolmap.ImageReaderOptions()
        reader.camera_model = job["camera_model"]
        if camera["parameters"]:
            reader.camera_params = camera["parameters"]
        pycolmap.extract_features(
            job["database"],
            job["images"],
            image_names=camera["names"],
            camera_mode=pycolmap.CameraMode.SINGLE,
            reader_options=reader,
            extraction_options=options,
        )
elif sys.argv[1] == "matching":
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads = job["threads"]
    pairing = pycolmap.ImportedPairingOptions()
    pairing.match_list_path = job["pairs"]
    pairing.block_size = job["pairs_per_block"]
    pycolmap.match_image_pairs(job["database"], matching_options=options, pairing_options=pairing)
else:
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads = job["threads"]
    options.random_seed = 0
    pycolmap.incremental_mapping(job["database"], job["images"], job["models"], options)
