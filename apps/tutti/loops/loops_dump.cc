#include <algorithm>
#include <cerrno>

#include "apps/tutti/files.h"
#include "apps/tutti/loops/loops_output.h"
#include "apps/tutti/text_table.h"

namespace tutti::cli {
namespace {

std::string CandidateLines(const LoopRun& run, const LoopResult& result, const LoopGroundTruth& truth) {
  std::string text;
  for (std::size_t i = 0; i < result.posterior_by_location.size(); ++i) {
    const auto& [location, combined] = result.posterior_by_location[i];
    const LoopLabel label = truth.At(static_cast<int>(result.query), static_cast<int>(location));
    std::string line = Formatted("%ld,%ld,%s,%.9g", run.Number(result.query), run.Number(location),
                                 LabelName(label), combined);
    bool any_score = false;
    for (const MemberOpinion& member : result.members) {
      if (i >= member.evidence.size()) {  // it sat this image out
        line += ",,,";
        continue;
      }
      const CandidateEvidence& evidence = member.evidence[i];
      any_score = any_score || evidence.score > 0;
      line += Formatted(",%.9g,%.9g,%.9g", evidence.score, evidence.likelihood, evidence.posterior);
    }
    if (any_score) text += line + "\n";
  }
  return text;
}

std::string VerificationLine(const LoopRun& run, const LoopResult& result, const Verification& tried,
                             int order, bool late, const LoopGroundTruth& truth) {
  const LoopLabel label = truth.At(static_cast<int>(result.query), static_cast<int>(tried.candidate));
  return Formatted("%ld,%ld,%s,%d,%d,%d,%d,%d,%s,%d,%d,%.9g,%d,%.9g,%.9g,%.9g,%.9g,",
                   run.Number(result.query), run.Number(tried.candidate), LabelName(label), order,
                   late ? 1 : 0, tried.similar ? 1 : 0, tried.accepted ? 1 : 0,
                   result.accepted && tried.candidate == result.candidate ? 1 : 0, ToString(tried.type),
                   tried.matches, tried.inliers, tried.mass, tried.coverage, tried.expected_inliers,
                   tried.log_nfa, tried.motion_spread, result.hypothesis) +
         Quoted(tried.reason) + "\n";
}

// A line for every location that is a loop, or that somebody believes in a little.
std::string PosteriorLines(const LoopRow& row, const LoopRun& run) {
  constexpr double kWorthALine = 1e-4;
  const LoopResult& r = row.result;
  std::string text;
  for (std::size_t i = 0; i < r.posterior_by_location.size(); ++i) {
    const auto& [location, combined] = r.posterior_by_location[i];
    double most = combined;
    const LoopLabel label = run.truth.At(static_cast<int>(r.query), static_cast<int>(location));
    std::string line = Formatted("%ld,%ld,%d,%.6g", run.Number(r.query), run.Number(location),
                                 static_cast<int>(label), combined);
    for (const MemberOpinion& member : r.members) {
      // A member that sat this image out has no posterior of it.
      const auto& posterior = member.posterior_by_location;
      const double value = i < posterior.size() ? posterior[i].second : 0.0;
      most = std::max(most, value);
      line += Formatted(",%.6g", value);
    }
    if (most >= kWorthALine || label == LoopLabel::kLoop) text += line + "\n";
  }
  return text;
}

void CheckWritten(const std::ofstream& out, const internal::ReplacedFile& file) {
  if (!out) internal::FailToWrite(file.target().string(), errno);
}

}  // namespace

LoopsDump::LoopsDump(const std::filesystem::path& folder, const std::vector<std::string>& members)
    : candidates_file_((MakeFolder(folder), folder / "dump_candidates.csv")),
      verification_file_(folder / "dump_verification.csv") {
  candidates_.open(candidates_file_.part(), std::ios::binary);
  verification_.open(verification_file_.part(), std::ios::binary);
  candidates_ << "image,location,truth,combined_posterior";
  for (const std::string& name : members) {
    candidates_ << "," << name << "_score," << name << "_likelihood," << name << "_posterior";
  }
  candidates_ << "\n";
  verification_
      << "image,candidate,truth,order,late,similar,accepted,chosen,type,matches,inliers,mass,coverage,"
         "expected_inliers,log_nfa,motion_spread,hypothesis,reason\n";
  CheckWritten(candidates_, candidates_file_);
  CheckWritten(verification_, verification_file_);
}

void LoopsDump::Add(const LoopRun& run, const LoopResult& result, const LoopGroundTruth& truth) {
  candidates_ << CandidateLines(run, result, truth);
  int order = 0;
  for (const Verification& tried : result.tried)
    verification_ << VerificationLine(run, result, tried, order++, false, truth);
}

void LoopsDump::AddLate(const LoopRun& run, const LoopResult& result, const LoopGroundTruth& truth) {
  if (result.verification.candidate >= 0)
    verification_ << VerificationLine(run, result, result.verification, 0, true, truth);
}

void LoopsDump::Finish() {
  candidates_.close();
  verification_.close();
  CheckWritten(candidates_, candidates_file_);
  CheckWritten(verification_, verification_file_);
  candidates_file_.Commit();
  verification_file_.Commit();
}

void WritePosteriors(const LoopRun& run, const std::filesystem::path& file) {
  std::string text = "image,location,truth,combined";
  for (const std::string& name : run.options.members) text += "," + name;
  text += "\n";
  for (const LoopRow& row : run.rows) text += PosteriorLines(row, run);
  internal::WriteFile(file, text);
}

}  // namespace tutti::cli
