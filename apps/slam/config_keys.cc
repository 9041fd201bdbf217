// Every key of the configuration: its name, what it means, and the field behind it. A test compares this
// table with the option structs' headers, so a field without a key does not pass.
#include "apps/slam/config_table.h"
#include "tutti/core/error.h"

namespace tutti {

template <typename Enum>
void ConfigTable::AddEnum(const char* name, Enum& field, EnumNames<Enum> names, const char* doc) {
  Push(
      name, doc,
      [&field, names](const YAML::Node& node) -> std::string {
        std::string valid;
        for (const auto& [word, value] : names) {
          if (node.IsScalar() && node.Scalar() == word) {
            field = value;
            return "";
          }
          valid += (valid.empty() ? "" : ", ") + word;
        }
        return (node.IsScalar() ? "'" + node.Scalar() + "' is not one of " : "needs one of ") + valid;
      },
      [&field, names]() -> std::string {
        for (const auto& [word, value] : names) {
          if (value == field) return word;
        }
        return "?";
      });
}

ConfigTable::ConfigTable(RunConfig& config) {
  if (!config.dataset.camera) config.dataset.camera = PinholeCamera();
  AddDataset(config.dataset);
  AddCamera(config.dataset);
  AddOdometry(config.odometry);
  AddLoops(config.loops);
  AddExtraction(config.loops.extraction);
  AddEvidence(config.loops.evidence);
  AddVocabulary(config.loops.vocabulary);
  AddVerification(config.loops.verification);
  AddDnn(config.loops.dnn);
  AddGraph(config.graph);
  AddRun(config.run);
}

void ConfigTable::AddDataset(DatasetOptions& o) {
  section_ = "dataset";
  Basic().AddEnum("type", o.type,
                  {{"auto", DatasetType::kAuto},
                   {"kitti", DatasetType::kKitti},
                   {"tum", DatasetType::kTum},
                   {"euroc", DatasetType::kEuroc},
                   {"images", DatasetType::kImages},
                   {"video", DatasetType::kVideo},
                   {"bag", DatasetType::kBag}},
                  "layout on disk: auto, kitti, tum, euroc, images, video, bag (ROS 1)");
  Basic().AddEnum("sensor", o.sensor,
                  {{"mono", Sensor::kMono}, {"stereo", Sensor::kStereo}, {"rgbd", Sensor::kRgbd}},
                  "mono, stereo or rgbd");
  Basic().Add("depth_units_per_m", o.depth_units_per_m, "RGB-D: value in the depth image of one metre");
  Basic().Add("max_depth_m", o.max_depth_m, "RGB-D: farther depth is not used [m]; 0: no limit");
  Add("max_association_s", o.max_association_s, "TUM: greatest time difference of colour and depth [s]");
  Basic().Add("rate_hz", o.rate_hz,
              "frame rate where the data has no time stamps [1/s]; 0: 10 Hz or the video's");
  Basic().Add("topic", o.topic,
              "ROS bag: topic of the left (or only, or colour) images; empty: the bag's only one");
  Basic().Add("right_topic", o.right_topic, "ROS bag, stereo: topic of the right images");
  Basic().Add("depth_topic", o.depth_topic,
              "ROS bag, RGB-D: topic of the depth images (16UC1: set depth_units_per_m: 1000)");
  Add("follow_s", o.follow_s,
      "wait for images that are still being written, end when none came for so long [s]; 0: don't wait");
  Basic().Add("stride", o.stride, "use every stride-th frame");
  Add("mirrored_ground_truth", o.mirrored_ground_truth, "the ground truth has its y axis up (ICL-NUIM)");
}

void ConfigTable::AddCamera(DatasetOptions& o) {
  section_ = "camera";
  PinholeCamera& c = *o.camera;
  Basic().Add("width", c.width, "image width [px]");
  Basic().Add("height", c.height, "image height [px]");
  Basic().Add("fx", c.fx, "focal length [px]");
  Basic().Add("fy", c.fy, "focal length [px]");
  Basic().Add("cx", c.cx, "principal point [px]; the centre of the top-left pixel is (0, 0)");
  Basic().Add("cy", c.cy, "principal point [px]");
  Basic().AddEnum("distortion", c.distortion,
                  {{"none", Distortion::kNone},
                   {"radtan", Distortion::kRadTan},
                   {"equidistant", Distortion::kEquidistant}},
                  "lens model: none, radtan, equidistant");
  Basic().Add("coefficients", c.coefficients, "radtan: k1 k2 p1 p2 k3; equidistant: k1 k2 k3 k4");
  Basic().Add("baseline_m", o.baseline_m,
              "stereo: distance of the cameras where the data does not say it [m]");
}

void ConfigTable::AddOdometry(OdometryOptions& o) {
  section_ = "odometry";
  Basic().Add("features", o.features, "ORB features per image");
  Add("pyramid_levels", o.pyramid_levels, "levels of the image pyramid");
  Add("scale_factor", o.scale_factor, "size ratio between two levels, > 1");
  Add("fast_threshold", o.fast_threshold,
      "FAST corner threshold [grey levels], where the image has enough corners");
  Add("fast_threshold_min", o.fast_threshold_min,
      "FAST threshold in parts of the image where there are too few [grey levels]");
  Basic().Add("stereo_sigma_px", o.stereo_sigma_px,
              "standard deviation of a disparity at pyramid level 0 [px]");
  Basic().Add("rgbd_inverse_sigma", o.rgbd_inverse_sigma,
              "RGB-D: standard deviation of inverse depth [1/m]; Kinect: about 0.0015 to 0.005");
  Add("max_depth_baselines", o.max_depth_baselines,
      "stereo: farther points are not trusted when they are new [baselines]");
  Add("lens_sigma", o.lens_sigma,
      "mono: radial distortion that the calibration may have left over, standard deviation [1]; 0: none");
  Basic().Add("pixel_sigma", o.pixel_sigma, "standard deviation of a keypoint at pyramid level 0 [px]");
  Basic().Add(
      "aligned_sigma", o.aligned_sigma,
      "standard deviation of a keypoint aligned with its landmark's patch, relative to a corner's, above 0 "
      "to 1");
  Basic().Add("min_inliers", o.min_inliers, "fewer landmarks that agree with the pose: the frame is lost");
  Basic().Add("relocalize_s", o.relocalize_s,
              "lost for longer than this [s], with something to see: start a new piece of map");
  Add("local_keyframes", o.local_keyframes, "keyframes whose landmarks are searched in a frame");
  Basic().Add("keyframe_inlier_ratio", o.keyframe_inlier_ratio,
              "new keyframe when fewer than this share of the reference's landmarks is seen, 0..1");
  Add("keyframe_uncovered_ratio", o.keyframe_uncovered_ratio,
      "stereo and depth: new keyframe when landmarks are missing in more than this share of the image's "
      "cells that have something to see, 0..1");
  Add("keyframe_max_interval_s", o.keyframe_max_interval_s,
      "new keyframe at the latest after this time, if the camera moved [s]");
  Add("keyframe_min_frames", o.keyframe_min_frames,
      "at least this many frames between keyframes (unless tracking gets weak)");
  Add("mapping_delay_frames", o.mapping_delay_frames,
      "what mapping makes of a keyframe enters so many frames later, and is waited for then [frames]");
  Add("triangulation_neighbours", o.triangulation_neighbours,
      "mono: keyframes with which new landmarks are triangulated");
  Add("min_parallax_deg", o.min_parallax_deg, "mono initialisation: median parallax [deg]");
  Add("ba_keyframes", o.ba_keyframes, "keyframes that local bundle adjustment moves");
  Add("ba_fixed_keyframes", o.ba_fixed_keyframes, "keyframes that hold the window in place");
  Add("ba_iterations", o.ba_iterations, "most iterations of a local bundle adjustment");
}

void ConfigTable::AddLoops(LoopDetectorOptions& o) {
  section_ = "loops";
  // A word that `take` understands or refuses with an InputError.
  const auto word = [&o](void (*take)(const std::string&, LoopDetectorOptions&)) {
    return [&o, take](const YAML::Node& node) -> std::string {
      try {
        take(node.IsScalar() ? node.Scalar() : "", o);
      } catch (const InputError& e) {
        return e.what();
      }
      return "";
    };
  };
  Basic().Push(
      "rule",
      "joint, mean, log-pool, product, majority, naive over the members, or one member's name for that alone",
      word(&SetRule), [&o] { return RuleName(o); });
  Basic().Push("preset",
               "published parameters that the other keys change: default, standardised-mean, paper-2013, "
               "rtabmap-0.8.3",
               word(&ApplyPreset), [] { return "default"; });
  Basic().Add("members", o.members,
              "members of the ensemble: surf, sift, orb, akaze, brisk, kaze, gftt, hog, dnn");
  AddEnum("likelihood", o.likelihood,
          {{"similarity", LikelihoodKind::kSimilarity}, {"tfidf", LikelihoodKind::kTfIdf}},
          "score of standardised evidence: similarity (2013) or tfidf");
  Basic().Add("loop_threshold", o.loop_threshold, "accept a loop of this probability, 0..1");
  Add("propose_threshold", o.propose_threshold, "go to verification at H >= this, 0..1");
  Add("link_threshold", o.link_threshold,
      "a loop of this probability links its two places for the filter, 0..1");
  Add("island_levels", o.island_levels,
      "candidates are ranked by the posterior of all within so many graph levels; 0: by their own");
  Add("consistent_images", o.consistent_images,
      "candidates of so many images before must lie on one path with this one; 0: no need");
  Add("hypothesis_ratio", o.hypothesis_ratio,
      "and at H >= this x the H of the image before; 0: whatever it was, 0..1");
  Basic().Add("stm_size", o.stm_size, "locations in short-term memory, no candidates");
  Add("threads", o.threads, "most threads that the detector uses at once");
  Basic().Add("seed", o.seed, "of kd-forests and RANSAC");
  Add("bad_signature_ratio", o.bad_signature_ratio,
      "a member sits out below this share of its mean number of features, 0..1");
  Add("ignore_bad_signatures", o.ignore_bad_signatures,
      "an image that is bad for every member is no location at all");
  Add("virtual_place_prior", o.virtual_place_prior, "p(new place | new place), 0..1");
  Add("rehearsal", o.rehearsal, "merge a location into its predecessor when they look the same");
  Add("rehearsal_similarity", o.rehearsal_similarity, "similarity from which on they do, 0..1");
  AddEnum("memory", o.memory, {{"shared", MemoryKind::kShared}, {"per_member", MemoryKind::kPerMember}},
          "shared: one memory for all members; per_member: one each, as in the paper");
  Basic().Add("wm_limit", o.wm_limit,
              "most locations in working memory, others go to long-term memory; 0: no limit");
  Basic().Add("time_budget_ms", o.time_budget_ms,
              "transfer while an image takes longer than this; not reproducible; 0: off [ms]");
  Add("retrieval", o.retrieval, "locations brought back from long-term memory per image");
  Add("recent_share", o.recent_share, "newest share of working memory that is never transferred, 0..1");
  Basic().Add("ltm_file", o.ltm_file,
              "SQLite file of the long-term memory, gone on with if it is there; empty: a temporary one");
  Add("keep_posterior", o.keep_posterior, "keep every posterior (costs time with many locations)");
  Add("keep_evidence", o.keep_evidence,
      "keep every raw score, likelihood and posterior (costs time with many locations)");
}

void ConfigTable::AddExtraction(ExtractionOptions& o) {
  section_ = "loops.extraction";
  Basic().Add("features", o.features, "strongest features kept per member and image, spread over the image");
  Add("grid_columns", o.grid_columns,
      "cells over which they are spread, along the longer side; 1: no spreading");
  Basic().Add("max_pixels", o.max_pixels,
              "images with more pixels are scaled down before anything else [px]");
  Add("min_pixels", o.min_pixels, "SURF and SIFT see an image of fewer pixels at twice its size [px]");
  Add("surf_octaves", o.surf_octaves, "octaves of the Hessian pyramid (the paper's 4)");
  Add("surf_threshold", o.surf_threshold,
      "determinant of Hessian below which a SURF point is dropped (dlib's scale)");
  Add("surf_min_threshold", o.surf_min_threshold,
      "where fewer than `features` reach surf_threshold, weaker ones are taken down to this");
  Add("sift_max_pixels", o.sift_max_pixels,
      "of SIFT's first octave: a larger image is scaled down to it [px]");
  Add("sift_contrast", o.sift_contrast, "contrast threshold of SIFT (OpenCV's own default is 0.04)");
  Add("sift_min_contrast", o.sift_min_contrast,
      "where fewer than `features` reach sift_contrast, weaker ones are taken down to this");
  Add("orb_fast_threshold", o.orb_fast_threshold, "FAST threshold of ORB [grey levels of 255]");
  Add("orb_border", o.orb_border,
      "border without ORB points, share of the shorter side, at most 31 px (1: OpenCV's own)");
  Add("root_sift", o.root_sift, "SIFT compared by the Hellinger kernel");
}

void ConfigTable::AddEvidence(EvidenceOptions& o) {
  section_ = "loops.evidence";
  AddEnum("kind", o.kind, {{"counts", EvidenceKind::kCounts}, {"standardised", EvidenceKind::kStandardised}},
          "what a score says of a place: counts against the level of wrong places, or standardised (2013)");
  Add("sharpness", o.sharpness, "exponent of a count beyond the alias level");
  Add("alias_share", o.alias_share,
      "share of the alias level that a place must reach to be more likely than a new one");
  Add("floor", o.floor, "least logarithm of a likelihood, below 0");
  Add("attraction", o.attraction, "how much more a place must show that many images resemble, 0 to 2");
  Add("persistence", o.persistence,
      "how much less successive images say where wrong places stay alike for several of them, 0 to 10");
}

void ConfigTable::AddVocabulary(VocabularyOptions& o) {
  section_ = "loops.vocabulary";
  Add("nndr", o.nndr, "a descriptor is an old word if d1 <= nndr * d2; on TRUE distance, not on its square");
  AddEnum("float_index", o.float_index, {{"forest", FloatIndex::kForest}, {"flann", FloatIndex::kFlann}},
          "for float descriptors: forest (ours) or flann (slower, for comparison)");
  Add("trees", o.trees, "kd-trees of the index (float descriptors)");
  Add("checks", o.checks, "leaves visited per search (float descriptors)");
  Add("hash_tables", o.hash_tables, "random tries of the Hamming index (binary descriptors)");
}

void ConfigTable::AddVerification(VerificationOptions& o) {
  section_ = "loops.verification";
  Basic().Add("enabled", o.enabled, "false: every proposal is accepted as it is, without a constraint");
  Add("max_hypotheses", o.max_hypotheses, "separate places tried, best posterior first");
  Add("neighbours", o.neighbours, "graph levels around each place that are tried as well; 0: none");
  Add("nearer_share", o.nearer_share,
      "without metric points: a nearer neighbour with this share of the best view's inliers is taken; 1: "
      "never");
  Add("match_ratio", o.match_ratio, "Lowe's ratio test, on true distance");
  Basic().Add("min_inliers", o.min_inliers, "fewer inliers than this are no loop");
  Add("min_inlier_ratio", o.min_inlier_ratio, "inliers / matches, 0..1");
  Add("min_epipolar_inliers", o.min_epipolar_inliers,
      "essential, fundamental matrix: a match is held to a line only, so more are needed");
  Add("min_epipolar_ratio", o.min_epipolar_ratio, "and a larger share of all matches, 0..1");
  Add("min_spread", o.min_spread, "rms extent of the inliers over the image, as share of its diagonal");
  Add("reprojection_px", o.reprojection_px, "RANSAC threshold of PnP, Sim(3) [px]");
  Add("epipolar_px", o.epipolar_px, "RANSAC threshold of the essential and fundamental matrix [px]");
  Add("homography_px", o.homography_px, "RANSAC threshold of the homography [px], 0: none is sought");
  Add("homography_share", o.homography_share,
      "a homography that explains this share of what the lines do decides in their place");
  Add("camera_share", o.camera_share,
      "of several cameras in an image each must find this share of the least inliers / cameras; 0..1");
  Add("static_px", o.static_px,
      "matches nearer than this to their own pixel did not move: others must do without them [px], 0: off");
  Add("scale_bar", o.scale_bar,
      "least numbers of inliers times members / 3: one member is judged as strictly as three");
  Add("confidence", o.confidence, "of RANSAC");
  Add("max_iterations", o.max_iterations, "of RANSAC");
  Add("pixel_sigma", o.pixel_sigma,
      "standard deviation of a matched pixel, sets the information matrix [px]");
  Add("min_depth_m", o.min_depth_m, "depths outside of the range count as unknown [m]");
  Basic().Add("max_depth_m", o.max_depth_m, "[m]");
}

void ConfigTable::AddDnn(DnnOptions& o) {
  section_ = "loops.dnn";
  Basic().Add("model", o.model, "member dnn: ONNX file of a network that describes a whole image");
  Basic().Add("width", o.width, "of the image that it gets, 16 to 4096 [px]");
  Basic().Add("height", o.height, "16 to 4096 [px]");
  Basic().Add("mean", o.mean, "subtracted from each channel, in the network's order [grey levels of 255]");
  Basic().Add("scale", o.scale, "and then multiplied by this, above 0");
  Basic().Add("stddev", o.stddev, "and each channel divided by this, above 0");
  Basic().Add("swap_rb", o.swap_rb, "the network takes red, green, blue; false: blue, green, red");
  Basic().Add("layer", o.layer, "whose output is the descriptor; empty: the network's only output");
}

void ConfigTable::AddGraph(PoseGraphOptions& o) {
  section_ = "graph";
  AddEnum("objective", o.objective, {{"chi2", GraphObjective::kChi2}, {"chi2log", GraphObjective::kChi2Log}},
          "rotation error as vector part of the quaternion (chi2) or as rotation vector (chi2log)");
  Basic().AddEnum("robust", o.robust,
                  {{"none", RobustLoss::kNone},
                   {"huber", RobustLoss::kHuber},
                   {"cauchy", RobustLoss::kCauchy},
                   {"dcs", RobustLoss::kDcs},
                   {"switchable", RobustLoss::kSwitchable},
                   {"gnc-tls", RobustLoss::kGncTls},
                   {"gnc", RobustLoss::kGnc}},
                  "loss on loop edges: none, huber, cauchy, dcs, switchable, gnc-tls, gnc");
  Add("pairwise_consistency", o.pairwise_consistency,
      "first keep only the largest set of loops that agree pair by pair (PCM)");
  Add("sigma_test", o.sigma_test, "last refuse loops that are off by more than 3 sigma");
  Add("robust_chi2", o.robust_chi2, "chi-square beyond which a loop is doubted; 0: its 99 % quantile");
  Basic().AddEnum(
      "solver", o.solver, {{"ceres", PoseGraphSolver::kCeres}, {"block", PoseGraphSolver::kBlock}},
      "who solves it: ceres, or block (own block Cholesky: the same optimum in less time; robust: switchable "
      "is left to ceres)");
  AddEnum("init", o.init,
          {{"auto", GraphInit::kAuto},
           {"file", GraphInit::kFile},
           {"odometry", GraphInit::kOdometry},
           {"chordal", GraphInit::kChordal}},
          "start from the present poses (file), odometry, chordal relaxation, or the best of them (auto)");
  Add("max_iterations", o.max_iterations, "of Levenberg-Marquardt");
  Add("function_tolerance", o.function_tolerance,
      "stop when an iteration lowers the cost by less than this share");
  Add("gnc_step", o.gnc_step, "cauchy, dcs, gnc: the threshold shrinks by this factor per round, > 1");
  Add("gnc_max_rounds", o.gnc_max_rounds, "gnc: most rounds");
  Add("gnc_start", o.gnc_start,
      "cauchy, dcs, gnc: the threshold starts at this many times the largest chi-square of a loop");
  Add("max_time_s", o.max_time_s, "stop after this time [s]; 0: no limit (a limit is not reproducible)");
}

void ConfigTable::AddRun(SlamOptions& o) {
  section_ = "run";
  Basic().Add("loops", o.loops, "search for loops and close them");
  Basic().Add("threads", o.threads, "most threads; the result is the same for any number");
  Basic().Add("loop_delay_frames", o.loop_delay_frames,
              "a detection enters this many frames after its keyframe");
  Add("loop_every_keyframes", o.loop_every_keyframes, "every n-th keyframe is searched");
  Basic().Add("loop_min_interval_s", o.loop_min_interval_s, "and no more often than this [s]");
  Add("loop_min_age_s", o.loop_min_age_s,
      "a candidate that is not this much older than the query is no loop [s]");
  Add("loop_apart_fraction", o.loop_apart_fraction,
      "mono: the two cameras stand at most this share of the median scene depth apart");
  Add("loop_pose_prior", o.loop_pose_prior,
      "stereo, RGB-D: the detector knows the odometry's position, and places out of reach lose");
  Basic().Add("loop_confirmations", o.loop_confirmations,
              "loops that must agree before the map moves; 1: trust each alone");
  Add("loop_confirmation_frames", o.loop_confirmation_frames, "and lie at most this many input frames apart");
  Add("loop_agree_fraction", o.loop_agree_fraction, "they agree within this share of the median scene depth");
  Add("loop_agree_deg", o.loop_agree_deg, "and within this angle [deg]");
  Add("loop_agree_scale", o.loop_agree_scale, "mono: and within this |log of the scale ratio|");
  Add("loop_after_fraction", o.loop_after_fraction,
      "a loop that is off by more than this share of the median scene depth after optimisation is taken out");
  Add("loop_after_deg", o.loop_after_deg, "the same for the angle [deg]");
  Add("loop_defer_fraction", o.loop_defer_fraction,
      "a loop that the map fulfils within this share of the depth waits for the next correction");
  Add("loop_defer_deg", o.loop_defer_deg, "and within this angle [deg]; 0: each loop moves the map");
  Add("loop_gate_sigmas", o.loop_gate_sigmas,
      "refuse loops farther than this Mahalanobis distance from what the map knows; 0: no such gate");
  Add("inject_false_loops", o.inject_false_loops,
      "test of the back end: so many false loops that look verified enter the pose graph");
  Add("covisibility_min_shared", o.covisibility_min_shared,
      "shared landmarks that make an edge in the pose graph");
  Add("covisibility_edges", o.covisibility_edges, "at most so many of them for each keyframe");
  Add("odometry_sigma_deg", o.odometry_sigma_deg, "standard deviation of an odometry edge's rotation [deg]");
  Add("odometry_sigma_fraction", o.odometry_sigma_fraction, "of its translation, as a share of its length");
  Add("odometry_sigma_scale", o.odometry_sigma_scale, "mono: of log(scale)");
  Add("loop_sigma_deg", o.loop_sigma_deg, "least standard deviation of a loop's rotation [deg]");
  Add("loop_sigma_fraction", o.loop_sigma_fraction,
      "of its translation, as a share of the median scene depth");
  Add("loop_sigma_scale", o.loop_sigma_scale, "mono: of log(scale)");
  Basic().Add(
      "global_adjustment", o.global_adjustment,
      "after loops: what both ends see becomes one, and the whole map is adjusted beside the tracking");
  Basic().Add("odometry_pass", o.odometry_pass,
              "after a correction, track the rest again without it for trajectory_odometry.txt");
}

}  // namespace tutti
