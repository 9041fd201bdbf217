// What bench/evidence_study works on: for every image, member and earlier location the matched words (by
// inverse frequency) in each cell of the image, with the ground truth, as one binary file OUT-N for each
// --still-in-sight N: above 0 without the words that have been in sight since a location older than
// short-term memory, as LikelihoodModel::Counts has it; 0: with all words.
//
// int32 images, rows of cells (8 columns); then images x images labels (uint8, row by row: 255 loop, 128
// ignore, 0 none); then for each image t and member: float32 features, float32 words, and (t + 1) x cells
// values (uint8, sixteenths), that of location 0 first.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <unordered_map>

#include "apps/tutti/loops/joined_pairs.h"
#include "apps/tutti/loops/loops_input.h"
#include "loopclosure/memory/likelihood.h"
#include "loopclosure/memory/member.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using Postings = std::unordered_map<int, std::vector<Posting>>;  // by word, of locations

template <typename T>
void Put(std::ofstream& out, const T& value) {
  out.write(reinterpret_cast<const char*>(&value), sizeof value);
}

using CellsOfWord = std::map<int, std::vector<int>>;

CellsOfWord Words(const Features& features, const cv::Size& size, int cells, Member& member) {
  CellsOfWord cells_of_word;
  const std::vector<int> words = member.vocabulary().Quantise(features.descriptors);
  member.vocabulary().AddReferences(Signature(words));
  for (std::size_t i = 0; i < words.size(); ++i) {
    const int cell = SeenWords::Cell(features.keypoints[i].pt, size);
    cells_of_word[words[i]].push_back(std::min(cell, cells - 1));
  }
  return cells_of_word;
}

// Matched words of an image by location and cell.
std::vector<double> Sums(const CellsOfWord& cells_of_word, const Postings& postings, int image, int cells,
                         int still_in_sight) {
  const Sight sight{still_in_sight > 0 ? image - LoopDetectorOptions().stm_size + 1 : 0};
  std::vector<double> sums(static_cast<std::size_t>(image + 1) * static_cast<std::size_t>(cells), 0.0);
  const double all = std::log10(image + 1.0);
  for (const auto& entry : cells_of_word) {
    const auto& in_cells = entry.second;
    const auto& list = postings.at(entry.first);
    if (all <= 0) break;
    const double value = std::log10((image + 1.0) / static_cast<double>(list.size())) / all /
                         static_cast<double>(in_cells.size());
    sight.ForEachReturn(list, image, [&](const Posting& posting) {
      for (const int cell : in_cells) {
        sums[static_cast<std::size_t>(posting.slot) * static_cast<std::size_t>(cells) +
             static_cast<std::size_t>(cell)] += posting.count * value;
      }
    });
  }
  return sums;
}

struct Output {
  int still_in_sight;
  std::ofstream stream;
};

void PutImage(const Features& features, const cv::Size& size, int image, int cells, Member& member,
              Postings& postings, std::vector<Output>& outputs) {
  const bool usable = member.Judge(features);
  const CellsOfWord cells_of_word = usable ? Words(features, size, cells, member) : CellsOfWord();
  for (const auto& [word, in_cells] : cells_of_word) {
    postings[word].push_back({image, static_cast<int>(in_cells.size())});
  }
  for (auto& [still_in_sight, out] : outputs) {
    Put(out, static_cast<float>(features.keypoints.size()));
    Put(out, static_cast<float>(usable ? features.keypoints.size() : 0));
    for (const double sum : Sums(cells_of_word, postings, image, cells, still_in_sight))
      Put(out, static_cast<std::uint8_t>(std::min(255.0, std::round(16 * sum))));
  }
}

void PutTruth(int cells, const LoopGroundTruth& truth, std::ofstream& out) {
  Put(out, truth.size());
  Put(out, cells / SeenWords::kColumns);
  for (int row = 0; row < truth.size(); ++row) {
    for (int column = 0; column < truth.size(); ++column)
      Put(out, static_cast<std::uint8_t>(truth.At(row, column)));
  }
}

int Run(const std::string& folder, const cli::GroundTruthArguments& truth_arguments, const std::string& file,
        const std::vector<int>& still_in_sight) {
  const auto [images, rights, truth, recording, depth, notes, stride] =
      cli::LoadImageSet(folder, truth_arguments);
  const LoopDetectorOptions options;
  std::vector<Member> members;
  members.reserve(options.members.size());
  for (const std::string& name : options.members)
    members.emplace_back(name, options, 1000003u + members.size());
  std::vector<Postings> postings(members.size());
  std::vector<Output> outputs;
  outputs.reserve(still_in_sight.size());
  for (const int images_apart : still_in_sight)
    outputs.push_back(
        {images_apart, std::ofstream(file + "-" + std::to_string(images_apart), std::ios::binary)});
  int cells = 0;
  for (int t = 0; t < truth.size(); ++t) {
    const std::size_t i = static_cast<std::size_t>(t);
    const cv::Mat image = rights[i].empty() ? cv::imread(images[i].string(), cv::IMREAD_UNCHANGED)
                                            : cli::ReadJoined(images[i], rights[i]);
    if (image.empty()) throw InputError(images[i].string() + ": can't be read");
    if (t == 0) {
      cells = SeenWords::Cell(cv::Point2f(1e6f, 1e6f), image.size()) + 1;
      cells = (cells + SeenWords::kColumns - 1) / SeenWords::kColumns * SeenWords::kColumns;
      for (Output& output : outputs) PutTruth(cells, truth, output.stream);
    }
    const cv::Mat grey = ToGrey8(image);
    for (std::size_t k = 0; k < members.size(); ++k) {
      PutImage(members[k].Extract(image, grey, cv::Mat()), image.size(), t, cells, members[k], postings[k],
               outputs);
    }
  }
  for (Output& output : outputs) {
    output.stream.close();
    if (!output.stream) throw InputError(file + ": can't be written; is there space?");
  }
  return 0;
}

}  // namespace
}  // namespace tutti

int main(int argc, char** argv) {
  CLI::App app("Matched words by cell, for bench/evidence_study");
  std::string images, out;
  std::vector<int> still_in_sight;
  tutti::cli::GroundTruthArguments truth;
  app.add_option("--images", images, "folder")->required();
  app.add_option("--ground-truth", truth.file, "loop matrix or trajectory")->required();
  app.add_option("--out", out, "files' names without -N")->required();
  app.add_option("--still-in-sight", still_in_sight, "N, may be repeated")->required();
  app.add_option("--stride", truth.stride, "every n-th image");
  app.add_flag("--join-pairs", truth.join_pairs, "left and right images make one");
  app.add_option("--gt-distance", truth.rule.distance_m, "[m]");
  app.add_option("--gt-angle", truth.rule.angle_deg, "[deg]");
  app.add_option("--gt-ignore", truth.rule.ignore_m, "[m]");
  app.add_option("--gt-exclude-s", truth.rule.exclude_s, "[s]");
  CLI11_PARSE(app, argc, argv);
  try {
    return tutti::Run(images, truth, out, still_in_sight);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "cell_counts: %s\n", e.what());
    return 2;
  }
}
