"""One stage of COLMAP by pycolmap, run by `strivec pose` in the folder of a capture."""

import argparse
import json
import sys

try:
    import pycolmap
except ImportError as error:
    print(error, file=sys.stderr)
    sys.exit(3)


def features(args):
    reader = pycolmap.ImageReaderOptions()
    reader.camera_model = args.camera_model
    extraction = pycolmap.FeatureExtractionOptions()
    extraction.num_threads = args.threads
    extraction.sift.max_num_features = args.max_features
    mode = pycolmap.CameraMode.PER_IMAGE if args.camera_each else pycolmap.CameraMode.SINGLE
    with open(args.pictures, encoding="utf-8") as names:
        pictures = [line for line in names.read().split("\n") if line]
    pycolmap.extract_features(
        args.database, args.images, pictures, mode, reader, extraction, device(args)
    )


def matching(args):
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads = args.threads
    if args.pairs == "exhaustive":
        pairing = pycolmap.ExhaustivePairingOptions()
        pairing.block_size = args.block_size
        match = pycolmap.match_exhaustive
    else:
        pairing = pycolmap.SequentialPairingOptions()
        pairing.quadratic_overlap = True
        pairing.loop_detection = args.vocab_tree is not None
        if args.vocab_tree is not None:
            pairing.vocab_tree_path = args.vocab_tree
        match = pycolmap.match_sequential
    match(args.database, options, pairing, device=device(args))


def mapping(args):
    if args.mapper == "global":
        # The global mapper depends on focal lengths, which pictures without EXIF data lack.
        pycolmap.calibrate_view_graph(args.database)
        options = pycolmap.GlobalPipelineOptions()
        options.mapper.global_positioning.use_gpu = args.gpu
        options.mapper.bundle_adjustment.ceres.use_gpu = args.gpu
        run = pycolmap.global_mapping
    else:
        options = pycolmap.IncrementalPipelineOptions()
        run = pycolmap.incremental_mapping
    options.num_threads = args.threads
    run(args.database, args.images, args.output, options)


def device(args):
    return pycolmap.Device.cuda if args.gpu else pycolmap.Device.cpu


def version(_):
    print(json.dumps({"version": pycolmap.__version__, "global": hasattr(pycolmap, "global_mapping")}))


parser = argparse.ArgumentParser()
parser.add_argument("stage", choices=["version", "features", "matching", "mapping"])
parser.add_argument("--database")
parser.add_argument("--images")
parser.add_argument("--pictures")
parser.add_argument("--output")
parser.add_argument("--camera-model")
parser.add_argument("--camera-each", action="store_true")
parser.add_argument("--max-features", type=int)
parser.add_argument("--pairs", choices=["exhaustive", "sequential"])
parser.add_argument("--block-size", type=int)
parser.add_argument("--vocab-tree")
parser.add_argument("--mapper", choices=["incremental", "global"])
parser.add_argument("--threads", type=int)
parser.add_argument("--gpu", action="store_true")
arguments = parser.parse_args()
{"version": version, "features": features, "matching": matching, "mapping": mapping}[arguments.stage](arguments)
