// What the detector says: tutti.LoopResult and what is in it. Arrays are views of the result, which they
// keep.
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include "apps/python/arrays.h"
#include "apps/python/bindings.h"
#include "apps/python/pickled.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::python {
namespace {

using Posterior = std::vector<std::pair<std::int64_t, double>>;

// One member of each element, without a copy.
template <class T, class Element>
py::array FieldsOf(const std::vector<Element>& elements, const T Element::*field, const py::object& owner) {
  const T* first = elements.empty() ? nullptr : &(elements.front().*field);
  py::array array(py::dtype::of<T>(), {static_cast<py::ssize_t>(elements.size())},
                  {static_cast<py::ssize_t>(sizeof(Element))}, first, owner);
  array.attr("flags").attr("writeable") = false;
  return array;
}

py::array Pixels(const std::vector<VerifiedMatch>& matches, const cv::Point2f VerifiedMatch::*field,
                 const py::object& owner) {
  const cv::Point2f* first = matches.empty() ? nullptr : &(matches.front().*field);
  py::array array(py::dtype::of<float>(), {static_cast<py::ssize_t>(matches.size()), py::ssize_t{2}},
                  {static_cast<py::ssize_t>(sizeof(VerifiedMatch)), static_cast<py::ssize_t>(sizeof(float))},
                  first, owner);
  array.attr("flags").attr("writeable") = false;
  return array;
}

template <class Class, class Field>
auto Locations(Field field) {
  return [field](const py::object& self) {
    return FieldsOf(self.cast<const Class&>().*field, &Posterior::value_type::first, self);
  };
}

template <class Class, class Field>
auto Posteriors(Field field) {
  return [field](const py::object& self) {
    return FieldsOf(self.cast<const Class&>().*field, &Posterior::value_type::second, self);
  };
}

template <class Class>
py::object EvidenceOf(const py::object& self) {
  const std::vector<CandidateEvidence>& evidence = self.cast<const Class&>().evidence;
  py::array array(py::dtype::of<CandidateEvidence>(), {static_cast<py::ssize_t>(evidence.size())},
                  {static_cast<py::ssize_t>(sizeof(CandidateEvidence))}, evidence.data(), self);
  array.attr("flags").attr("writeable") = false;
  return std::move(array);
}

std::string Evidence(const char* text) {
  return std::string(text) + "\n\nA structured array with the fields location (" +
         doc::CandidateEvidence_location + "), score (" + doc::CandidateEvidence_score + "), likelihood (" +
         doc::CandidateEvidence_likelihood + "), posterior (" + doc::CandidateEvidence_posterior + ").";
}

void BindMember(py::module_& module) {
  PYBIND11_NUMPY_DTYPE(CandidateEvidence, location, score, likelihood, posterior);
  py::class_<MemberOpinion>(module, "MemberOpinion", doc::MemberOpinion)
      .def(Pickled<MemberOpinion>())
      .def_readonly("name", &MemberOpinion::name, doc::MemberOpinion_name)
      .def_readonly("took_part", &MemberOpinion::took_part, doc::MemberOpinion_took_part)
      .def_readonly("features", &MemberOpinion::features, doc::MemberOpinion_features)
      .def_readonly("words", &MemberOpinion::words, doc::MemberOpinion_words)
      .def_readonly("hypothesis", &MemberOpinion::hypothesis, doc::MemberOpinion_hypothesis)
      .def_readonly("best", &MemberOpinion::best, doc::MemberOpinion_best)
      .def_readonly("weight", &MemberOpinion::weight, doc::MemberOpinion_weight)
      .def_readonly("at_candidate", &MemberOpinion::at_candidate, doc::MemberOpinion_at_candidate)
      .def_property_readonly(
          "locations", Locations<MemberOpinion>(&MemberOpinion::posterior_by_location),
          "(N,) int64: ids of the places that `posteriors` is about; only with keep_posterior.")
      .def_property_readonly(
          "posteriors", Posteriors<MemberOpinion>(&MemberOpinion::posterior_by_location),
          "(N,) float64, 0..1: its posterior of each of `locations`; only with keep_posterior.")
      .def_property_readonly("evidence", &EvidenceOf<MemberOpinion>,
                             Evidence(doc::MemberOpinion_evidence).c_str())
      .def("__repr__", [](const MemberOpinion& member) {
        return py::str("MemberOpinion('{}', hypothesis={:.4g}, best={})")
            .format(member.name, member.hypothesis, member.best);
      });
}

void BindVerification(py::module_& module) {
  py::class_<Verification>(module, "Verification", doc::Verification)
      .def(Pickled<Verification>())
      .def_readonly("candidate", &Verification::candidate, doc::Verification_candidate)
      .def_readonly("similar", &Verification::similar, doc::Verification_similar)
      .def_readonly("accepted", &Verification::accepted, doc::Verification_accepted)
      .def_property_readonly(
          "type", [](const Verification& v) { return ToString(v.type); },
          "which geometry decided: none, fundamental, essential, rigid or similarity")
      .def_property_readonly(
          "S_candidate_query", [](const Verification& v) { return ArrayOf(v.S_candidate_query); },
          (std::string("(4, 4) float64: ") + doc::Verification_S_candidate_query).c_str())
      .def_property_readonly(
          "scale", [](const Verification& v) { return v.S_candidate_query.scale; }, "of S_candidate_query")
      .def_property_readonly(
          "information", [](const Verification& v) { return ArrayOf(Eigen::MatrixXd(v.information)); },
          (std::string("(6, 6) float64: ") + doc::Verification_information).c_str())
      .def_readonly("homography", &Verification::homography, doc::Verification_homography)
      .def_readonly("matches", &Verification::matches, doc::Verification_matches)
      .def_readonly("inliers", &Verification::inliers, doc::Verification_inliers)
      .def_readonly("coverage", &Verification::coverage, doc::Verification_coverage)
      .def_readonly("expected_inliers", &Verification::expected_inliers, doc::Verification_expected_inliers)
      .def_readonly("log_nfa", &Verification::log_nfa, doc::Verification_log_nfa)
      .def_readonly("motion_spread", &Verification::motion_spread, doc::Verification_motion_spread)
      .def_readonly("mass", &Verification::mass, doc::Verification_mass)
      .def_readonly("reason", &Verification::reason, doc::Verification_reason)
      .def_property_readonly(
          "query_pixels",
          [](const py::object& self) {
            return Pixels(self.cast<const Verification&>().inlier_matches, &VerifiedMatch::query, self);
          },
          "(inliers, 2) float32: x, y [px] of the matches that fit, in the query's image.")
      .def_property_readonly(
          "candidate_pixels",
          [](const py::object& self) {
            return Pixels(self.cast<const Verification&>().inlier_matches, &VerifiedMatch::candidate, self);
          },
          "(inliers, 2) float32: the same in the candidate's image.")
      .def("__repr__", [](const Verification& v) {
        return py::str("Verification(candidate={}, accepted={}, type='{}', inliers={}, reason='{}')")
            .format(v.candidate, v.accepted, ToString(v.type), v.inliers, v.reason);
      });
}

}  // namespace

void BindLoopResult(py::module_& module) {
  BindMember(module);
  BindVerification(module);
  py::class_<LateLoop>(module, "LateLoop", doc::LateLoop)
      .def_readonly("query", &LateLoop::query, doc::LateLoop_query)
      .def_readonly("accepted", &LateLoop::accepted, doc::LateLoop_accepted)
      .def_readonly("withdrawn", &LateLoop::withdrawn, doc::LateLoop_withdrawn)
      .def_readonly("probability", &LateLoop::probability, doc::LateLoop_probability)
      .def_readonly("verification", &LateLoop::verification, doc::LateLoop_verification)
      .def("__repr__", [](const LateLoop& late) {
        return py::str("LateLoop(query={}, accepted={}, withdrawn={}, candidate={}, probability={:.4g})")
            .format(late.query, late.accepted, late.withdrawn, late.verification.candidate, late.probability);
      });
  py::class_<LoopResult>(module, "LoopResult", doc::LoopResult)
      .def(Pickled<LoopResult>())
      .def_readonly("query", &LoopResult::query, doc::LoopResult_query)
      .def_readonly("hypothesis", &LoopResult::hypothesis, doc::LoopResult_hypothesis)
      .def_readonly("candidate", &LoopResult::candidate, doc::LoopResult_candidate)
      .def_readonly("best", &LoopResult::best, doc::LoopResult_best)
      .def_readonly("posterior", &LoopResult::posterior, doc::LoopResult_posterior)
      .def_readonly("probability", &LoopResult::probability, doc::LoopResult_probability)
      .def_readonly("proposed", &LoopResult::proposed, doc::LoopResult_proposed)
      .def_readonly("accepted", &LoopResult::accepted, doc::LoopResult_accepted)
      .def_readonly("reason", &LoopResult::reason, doc::LoopResult_reason)
      .def_readonly("members", &LoopResult::members, doc::LoopResult_members)
      .def_readonly("verification", &LoopResult::verification, doc::LoopResult_verification)
      .def_readonly("tried", &LoopResult::tried, doc::LoopResult_tried)
      .def_readonly("late", &LoopResult::late, doc::LoopResult_late)
      .def_property_readonly("locations", Locations<LoopResult>(&LoopResult::posterior_by_location),
                             "(N,) int64: ids of the places that `posteriors` is about; only with "
                             "keep_posterior or keep_evidence.")
      .def_property_readonly("posteriors", Posteriors<LoopResult>(&LoopResult::posterior_by_location),
                             (std::string("(N,) float64, 0..1, parallel to `locations`. ") +
                              doc::LoopResult_posterior_by_location)
                                 .c_str())
      .def_property_readonly("evidence", &EvidenceOf<LoopResult>, Evidence(doc::LoopResult_evidence).c_str())
      .def_readonly("retrieved", &LoopResult::retrieved, doc::LoopResult_retrieved)
      .def_readonly("transferred", &LoopResult::transferred, doc::LoopResult_transferred)
      .def_readonly("warning", &LoopResult::warning, doc::LoopResult_warning)
      .def_readonly("extract_ms", &LoopResult::extract_ms, doc::LoopResult_extract_ms)
      .def_readonly("quantise_ms", &LoopResult::quantise_ms, doc::LoopResult_quantise_ms)
      .def_readonly("likelihood_ms", &LoopResult::likelihood_ms, doc::LoopResult_likelihood_ms)
      .def_readonly("filter_ms", &LoopResult::filter_ms, doc::LoopResult_filter_ms)
      .def_readonly("verify_ms", &LoopResult::verify_ms, doc::LoopResult_verify_ms)
      .def_readonly("memory_ms", &LoopResult::memory_ms, doc::LoopResult_memory_ms)
      .def("__repr__", [](const LoopResult& result) {
        return py::str("LoopResult(query={}, accepted={}, candidate={}, probability={:.4g}, reason='{}')")
            .format(result.query, result.accepted, result.candidate, result.probability, result.reason);
      });
}

}  // namespace tutti::python
