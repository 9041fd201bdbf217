#include "apps/export/map_export.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <system_error>

#include "apps/export/colmap_model.h"
#include "apps/export/keyframe_images.h"
#include "apps/export/map_files.h"
#include "apps/run/output_folder.h"
#include "core/replaced_file.h"
#include "frontend/dataset/image_file.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/core/error.h"
#include "tutti/slam/version.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTransforms = "transforms.json";
constexpr const char* kPoints = "sparse_pc.ply";  // nerfstudio's own name for it
constexpr const char* kMark = "export.json";

bool IsExport(const fs::path& entry) {
  constexpr std::array<const char*, 5> kNames = {"images", "sparse", kTransforms, kPoints, kMark};
  return std::find(kNames.begin(), kNames.end(), entry.filename().string()) != kNames.end();
}

// Files of the same command, as of another call, that it has put into the folder by name.
bool IsNamedFile(const fs::path& entry) {
  constexpr std::array<const char*, 4> kExtensions = {".ply", ".g2o", ".tum", ".txt"};
  std::error_code ignored;
  return entry.filename() != kPoints && fs::is_regular_file(entry, ignored) &&
         std::find(kExtensions.begin(), kExtensions.end(), entry.extension().string()) != kExtensions.end();
}

fs::path Resolved(const fs::path& path) {
  std::error_code ignored;
  const fs::path whole = fs::weakly_canonical(fs::absolute(path), ignored);
  return whole.filename().empty() ? whole.parent_path() : whole;
}

// A folder that gets images, and what else.
struct ImageFolder {
  fs::path path;  // as given
  bool colmap = false, transforms = false;
  std::unique_ptr<OutputFolder> output;
};

std::vector<ImageFolder> OpenFolders(const ExportRequest& request) {
  std::vector<ImageFolder> folders;
  if (request.colmap) folders.push_back({*request.colmap, true, false, nullptr});
  if (request.transforms) {
    if (request.transforms->filename() != kTransforms)
      throw InputError(request.transforms->string() + ": the file must be called " + kTransforms +
                       ", as nerfstudio looks for it; its images go into a folder beside it");
    fs::path parent = request.transforms->parent_path();
    if (parent.empty()) parent = ".";
    if (request.colmap && Resolved(parent) == Resolved(*request.colmap))
      folders.front().transforms = true;
    else
      folders.push_back({parent, false, true, nullptr});
  }
  for (ImageFolder& folder : folders) {
    OutputLayout layout = {IsExport, kMark, "tutti", {}, IsNamedFile};
    layout.option = folder.colmap ? "--colmap" : "--transforms";
    folder.output = std::make_unique<OutputFolder>(folder.path, layout);
  }
  return folders;
}

void WriteImages(const fs::path& folder, const KeyframeImages& images, const MapModel& model,
                 const std::vector<std::size_t>& chosen) {
  fs::create_directory(folder);
  for (const std::size_t k : chosen) {
    const ColourImage read = images.Read(model.keyframes[k]);
    if (!read.error.empty()) throw InputError(read.error);
    WritePngFile(folder / ImageName(model.keyframes[k].frame_index), read.image);
  }
}

std::string TwoDecimals(double number) {
  char text[48];
  std::snprintf(text, sizeof text, "%.2f", number);
  return text;
}

std::string Count(std::size_t number, const std::string& what) {
  return std::to_string(number) + " " + what + (number == 1 ? "" : "s");
}

// All that goes into folders with images.
class FolderExport {
 public:
  FolderExport(const MapModel& model, const KeyframeImages& images, std::vector<std::size_t> chosen,
               bool colmap)
      : model_(model), images_(images), chosen_(std::move(chosen)) {
    if (!colmap) return;
    MapModel tracks = model;
    changes_ = RefineTracks(images, chosen_, &tracks);
    colmap_.emplace(tracks, chosen_);
  }

  void Write(ImageFolder* folder) const {
    OutputFolder& out = *folder->output;
    out.Write({"images", [this](const fs::path& p) { WriteImages(p, images_, model_, chosen_); }});
    if (folder->colmap) {
      out.Write({"sparse", [this](const fs::path& p) {
                   fs::create_directories(p / "0");
                   colmap_->Write(p / "0");
                 }});
    }
    if (folder->transforms) {
      out.Write({kPoints, [this](const fs::path& p) { WritePly(p, model_, PlyCameras::kNone); }});
      out.Write({kTransforms, [this](const fs::path& p) {
                   internal::WriteFile(p, NerfTransforms(model_, chosen_, kPoints));
                 }});
    }
    out.Write({kMark, [this](const fs::path& p) { internal::WriteFile(p, Mark()); }});
    ThrowFailures(out.failures(), out.Finish(true));
  }

  void Tell(const ImageFolder& folder, ExportReport* report) const {
    const std::string images = Count(chosen_.size(), "image");
    if (folder.colmap) {
      const std::string path = folder.path.string();
      report->files.push_back(
          {folder.path,
           images + ", " + Count(colmap_->Points().size(), "point") + " with a mean track length of " +
               TwoDecimals(colmap_->MeanTrackLength()) + "; left out: " + std::to_string(colmap_->LeftOut()) +
               " landmarks that fewer than two of the images see, " + std::to_string(changes_.dropped) +
               " views more than " + TwoDecimals(changes_.most_px) +
               " px off; added: " + std::to_string(changes_.added) + " views found in the images",
           "colmap gui, File > Import model, " + path +
               "/sparse/0; or a trainer of Gaussian splats: train.py -s " + path});
    }
    if (folder.transforms)
      report->files.push_back({folder.path / kTransforms,
                               images + ", " + Count(model_.landmarks.size(), "landmark") + " in " + kPoints,
                               "ns-train splatfacto --data " + folder.path.string()});
  }

 private:
  std::string Mark() const {
    const nlohmann::ordered_json json = {{"tutti", kVersion},
                                         {"images", chosen_.size()},
                                         {"keyframes", model_.keyframes.size()},
                                         {"landmarks", model_.landmarks.size()}};
    return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
  }

  const MapModel& model_;
  const KeyframeImages& images_;
  const std::vector<std::size_t> chosen_;
  std::optional<ColmapModel> colmap_;
  TrackChanges changes_;
};

void WarnOfMissingImages(const Looks& looks, const MapModel& model, ExportReport* report) {
  if (looks.errors.empty()) return;
  report->warnings.push_back(std::to_string(looks.errors.size()) + " of " +
                             Count(model.keyframes.size(), "keyframe") +
                             " have no image; the first: " + looks.errors.front());
}

void WriteFiles(const MapModel& model, const ExportRequest& request, ExportReport* report) {
  if (request.tum) {
    WriteTrajectory(*request.tum, model.trajectory, TrajectoryFormat::kTum);
    report->files.push_back({*request.tum, Count(model.trajectory.size(), "pose"),
                             "tutti evaluate, tutti plot, evo_traj tum " + request.tum->string()});
  }
  if (request.g2o) {
    WriteG2o(*request.g2o, model.graph);
    report->files.push_back(
        {*request.g2o,
         Count(model.graph.nodes().size(), "keyframe") + ", " + Count(model.graph.edges().size(), "edge"),
         std::string("tutti optimize") + (model.graph.kind() == GraphKind::kSim3
                                              ? " (edges with scale are tutti's own)"
                                              : ", g2o_viewer " + request.g2o->string())});
  }
  if (request.landmarks) {
    WritePly(*request.landmarks, model, PlyCameras::kFrusta);
    report->files.push_back({*request.landmarks,
                             Count(model.landmarks.size(), "landmark") + ", " +
                                 Count(model.keyframes.size(), "keyframe") + " as pyramids",
                             "CloudCompare, MeshLab (Render > Show Points), Blender"});
  }
}

}  // namespace

ExportReport ExportMap(MapModel model, const Dataset* dataset, const ExportRequest& request) {
  const bool wants_images = request.colmap || request.transforms;
  if (!wants_images && !request.landmarks && !request.g2o && !request.tum)
    throw InputError("there is nothing to export; give --landmarks, --colmap, --transforms, --g2o or --tum");
  if (wants_images && dataset == nullptr)
    throw InputError("--colmap and --transforms need the images that the map was made of; give --dataset");
  ExportReport report;
  if (model.other_keyframes > 0)
    report.warnings.push_back(Count(model.other_keyframes, "keyframe") +
                              " of submaps that no loop joined to the largest one are left out");
  std::vector<ImageFolder> folders = OpenFolders(request);
  std::optional<KeyframeImages> images;
  Looks looks;
  if (dataset != nullptr && (wants_images || request.landmarks)) {
    images.emplace(*dataset, model);
    looks = LookAtImages(*images, &model);
    WarnOfMissingImages(looks, model, &report);
  } else if (request.landmarks) {
    report.warnings.push_back("without --dataset there are no images: all landmarks are grey");
  }
  WriteFiles(model, request, &report);
  if (!wants_images) return report;
  std::vector<std::size_t> chosen = ChooseImages(model.keyframes, looks.sharpness, request.images);
  if (chosen.empty()) throw InputError("no keyframe has an image; the first: " + looks.errors.front());
  const FolderExport into(model, *images, std::move(chosen), request.colmap.has_value());
  for (ImageFolder& folder : folders) {
    into.Write(&folder);
    into.Tell(folder, &report);
  }
  return report;
}

}  // namespace tutti
