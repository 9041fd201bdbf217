#!/usr/bin/env python3
"""Small networks for the tests of the member dnn, as ONNX files.

usage: write_network.py FOLDER

Needs python3-onnx (Debian's package, which is for /usr/bin/python3); says so and exits with 77 where it is missing.
"""
import pathlib
import sys

try:
    import numpy
    import onnx
    from onnx import TensorProto, helper, numpy_helper
except ImportError as error:
    print(f"python3-onnx is missing ({error}); apt-get install python3-onnx")
    sys.exit(77)

WIDTH, HEIGHT = 64, 48  # of the images that the networks take [px]
RANDOM = numpy.random.RandomState(1)


def save(folder, name, nodes, constants, outputs, width=WIDTH, height=HEIGHT, opset=11):
    """Writes name.onnx: `constants` is {name: array}, `outputs` is {name: shape}."""
    image = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, height, width])
    ends = [helper.make_tensor_value_info(n, TensorProto.FLOAT, shape) for n, shape in outputs.items()]
    values = [numpy_helper.from_array(numpy.asarray(v, numpy.float32), n) for n, v in constants.items()]
    graph = helper.make_graph(nodes, name, [image], ends, values)
    # What OpenCV 4.5.4 reads: it knows no later ones.
    model = helper.make_model(graph, producer_name="tutti", opset_imports=[helper.make_opsetid("", opset)])
    model.ir_version = 6
    onnx.checker.check_model(model)
    onnx.save(model, str(folder / f"{name}.onnx"))


def conv(source, target, weights, name, **options):
    side = numpy.asarray(options.pop("of")).shape[2]
    return helper.make_node("Conv", [source, weights], [target], name=name, kernel_shape=[side, side], **options)


def unit_length(source, target, name):
    """What torch.onnx.export makes of torch.nn.functional.normalize, below opset 11."""
    node = helper.make_node
    return [node("ReduceL2", [source], [name + "_length"], axes=[1], keepdims=1), node("Clip", [name + "_length"], [name + "_least"], min=1e-12),
            node("Shape", [source], [name + "_shape"]), node("Expand", [name + "_least", name + "_shape"], [name + "_all"]),
            node("Div", [source, name + "_all"], [target])]


def main():
    folder = pathlib.Path(sys.argv[1])
    node = helper.make_node
    ends = [node("GlobalAveragePool", ["mixed"], ["pooled"], name="pool"), node("Flatten", ["pooled"], ["descriptor"], name="flatten")]

    # Means of the three channels, and their sum.
    mix = numpy.reshape([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], (4, 3, 1, 1))
    first = conv("image", "mixed", "mix_w", "mix", of=mix)
    save(folder, "means", [first, *ends], {"mix_w": mix}, {"descriptor": [1, 4]})
    # The same in another order: as long, but not the same.
    save(folder, "other", [first, *ends], {"mix_w": mix[::-1]}, {"descriptor": [1, 4]})
    # And three of them: shorter.
    first = conv("image", "mixed", "mix_w", "mix", of=mix[:3])
    save(folder, "three", [first, *ends], {"mix_w": mix[:3]}, {"descriptor": [1, 3]})
    # A picture in place of a vector, and one number.
    save(folder, "map", [conv("image", "mixed", "mix_w", "mix", of=mix)], {"mix_w": mix}, {"mixed": [1, 4, HEIGHT, WIDTH]})
    save(folder, "one", [conv("image", "mixed", "mix_w", "mix", of=mix[:1]), *ends], {"mix_w": mix[:1]}, {"descriptor": [1, 1]})
    # Two outputs.
    save(folder, "two", [node("GlobalAveragePool", ["image"], ["mean"], name="average"), node("GlobalMaxPool", ["image"], ["most"], name="maximum")],
         {}, {"mean": [1, 3, 1, 1], "most": [1, 3, 1, 1]})
    # More than a float can hold.
    save(folder, "huge", [conv("image", "mixed", "mix_w", "mix", of=mix), *ends], {"mix_w": 3e38 * mix}, {"descriptor": [1, 4]})
    # For images of one size only.
    save(folder, "sized",
         [node("Flatten", ["image"], ["flat"], name="flatten"), node("Gemm", ["flat", "full_w"], ["descriptor"], name="full", transB=1)],
         {"full_w": RANDOM.randn(5, 3 * HEIGHT * WIDTH)}, {"descriptor": [1, 5]})

    # Edges in eight directions, summed over cells of 8 x 8 pixels: tells places apart.
    angles = numpy.arange(8) * numpy.pi / 4
    y, x = numpy.mgrid[-1:2, -1:2]
    edges = numpy.array([numpy.repeat([numpy.cos(a) * x + numpy.sin(a) * y], 3, axis=0) for a in angles])
    save(folder, "edges",
         [conv("image", "steps", "edge_w", "edge", of=edges, pads=[1, 1, 1, 1]), node("Relu", ["steps"], ["slopes"], name="relu"),
          node("AveragePool", ["slopes"], ["cells"], name="cells", kernel_shape=[8, 8], strides=[8, 8]),
          node("Flatten", ["cells"], ["descriptor"], name="flatten")], {"edge_w": edges}, {"descriptor": [1, 8 * 6 * 8]})

    # The head of CosPlace and EigenPlaces as it is exported: generalised means of normalised features, a linear layer.
    rows, columns = HEIGHT // 2, WIDTH // 2
    w = RANDOM.randn(16, 3, 3, 3)
    save(folder, "gem",
         [conv("image", "raw", "first_w", "first", of=w, pads=[1, 1, 1, 1], strides=[2, 2]), node("Relu", ["raw"], ["features"]),
          *unit_length("features", "even", "a"), node("Clip", ["even"], ["positive"], min=1e-6), node("Pow", ["positive", "p"], ["cubes"]),
          node("AveragePool", ["cubes"], ["mean"], kernel_shape=[rows, columns], strides=[rows, columns]),
          node("Pow", ["mean", "root"], ["pooled"], name="pool"), node("Flatten", ["pooled"], ["flat"]),
          node("Gemm", ["flat", "full_w", "full_b"], ["full"], transB=1), *unit_length("full", "descriptor", "b")],
         {"first_w": w, "p": [3], "root": [1 / 3], "full_w": RANDOM.randn(32, 16), "full_b": RANDOM.randn(32)},
         {"descriptor": [1, 32]}, opset=10)

    # Random weights, and sizes that do not divide evenly among threads.
    nodes, constants, last, width = [], {}, "image", 3
    for i, channels in enumerate([16, 24, 33, 48, 61]):
        w = constants[f"w{i}"] = RANDOM.randn(channels, width, 3, 3) / numpy.sqrt(9 * width)
        nodes.append(conv(last, f"c{i}", f"w{i}", f"conv{i}", of=w, pads=[1, 1, 1, 1], strides=[1 + i % 2] * 2))
        nodes.append(node("Relu", [f"c{i}"], [f"r{i}"], name=f"relu{i}"))
        last, width = f"r{i}", channels
    nodes += [node("GlobalAveragePool", [last], ["pooled"], name="pool"), node("Flatten", ["pooled"], ["flat"], name="flatten"),
              node("Gemm", ["flat", "full_w"], ["descriptor"], name="full", transB=1)]
    constants["full_w"] = RANDOM.randn(131, width)
    save(folder, "deep", nodes, constants, {"descriptor": [1, 131]}, 157, 117)


if __name__ == "__main__":
    main()
