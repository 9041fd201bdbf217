#include "apps/tutti/plot_file.h"

#ifdef TUTTI_WITH_CAIRO
#include <cairo-pdf.h>
#include <cairo.h>

#include <memory>
#endif

#include "apps/plot/plot_picture.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

#ifdef TUTTI_WITH_CAIRO

void DrawText(cairo_t* page, const PlotShape& shape) {
  cairo_set_font_size(page, shape.size);
  cairo_text_extents_t extents;
  cairo_text_extents(page, shape.text.c_str(), &extents);
  const double shift = shape.anchor == PlotShape::Anchor::kStart    ? 0.0
                       : shape.anchor == PlotShape::Anchor::kMiddle ? 0.5 * extents.x_advance
                                                                    : extents.x_advance;
  cairo_save(page);
  cairo_translate(page, shape.points[0].x(), shape.points[0].y());
  if (shape.vertical) cairo_rotate(page, -0.5 * M_PI);
  cairo_move_to(page, -shift, 0);
  cairo_show_text(page, shape.text.c_str());
  cairo_restore(page);
}

void DrawLine(cairo_t* page, const PlotShape& shape) {
  static constexpr double kDash[] = {7, 5};  // as in the SVG
  cairo_set_line_width(page, shape.size);
  cairo_set_dash(page, kDash, shape.dashed ? 2 : 0, 0);
  for (const Eigen::Vector2d& p : shape.points) cairo_line_to(page, p.x(), p.y());
  cairo_stroke(page);
}

void Draw(cairo_t* page, const PlotShape& shape) {
  const cv::Scalar bgr = PlotColor(shape.color);
  cairo_set_source_rgb(page, bgr[2] / 255, bgr[1] / 255, bgr[0] / 255);
  const Eigen::Vector2d& p = shape.points[0];
  switch (shape.kind) {
    case PlotShape::Kind::kLine:
      DrawLine(page, shape);
      break;
    case PlotShape::Kind::kDisc:
      cairo_arc(page, p.x(), p.y(), shape.size, 0, 2 * M_PI);
      cairo_fill(page);
      break;
    case PlotShape::Kind::kBox: {
      const Eigen::Vector2d size = shape.points[1] - p;
      cairo_rectangle(page, p.x(), p.y(), size.x(), size.y());
      cairo_fill(page);
      break;
    }
    case PlotShape::Kind::kText:
      DrawText(page, shape);
      break;
  }
}

void WritePdf(const std::filesystem::path& file, const std::vector<PlotShape>& shapes) {
  const std::unique_ptr<cairo_surface_t, void (*)(cairo_surface_t*)> surface(
      cairo_pdf_surface_create(file.c_str(), kPlotWidth, kPlotHeight), cairo_surface_destroy);
  // The same bytes from the same input: no time of day in the file.
  cairo_pdf_surface_set_metadata(surface.get(), CAIRO_PDF_METADATA_CREATE_DATE, "2000-01-01T00:00:00Z");
  const std::unique_ptr<cairo_t, void (*)(cairo_t*)> page(cairo_create(surface.get()), cairo_destroy);
  cairo_select_font_face(page.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  for (const PlotShape& shape : shapes) Draw(page.get(), shape);
  cairo_show_page(page.get());
  cairo_surface_finish(surface.get());
  if (cairo_status(page.get()) != CAIRO_STATUS_SUCCESS ||
      cairo_surface_status(surface.get()) != CAIRO_STATUS_SUCCESS)
    throw InputError(file.string() + ": can't be written; check that the folder is writable and not full");
}

#else

void WritePdf(const std::filesystem::path& file, const std::vector<PlotShape>&) { CheckPlotFile(file); }

#endif

}  // namespace

void CheckPlotFile(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending != ".svg" && ending != ".png" && ending != ".pdf")
    throw InputError(file.string() + ": the name of a plot ends in .svg, .png or .pdf");
#ifndef TUTTI_WITH_CAIRO
  if (ending == ".pdf") {
    throw InputError(file.string() +
                     ": this tutti was built without Cairo (Debian: libcairo2-dev), so it writes no PDF; "
                     "choose .svg or .png");
  }
#endif
}

void WritePlotFile(const std::filesystem::path& file, const std::vector<PlotShape>& shapes) {
  CheckPlotFile(file);
  if (file.extension() == ".pdf") {
    WritePdf(file, shapes);
  } else if (file.extension() == ".svg") {
    WriteSvg(file, shapes, kPlotWidth, kPlotHeight);
  } else {
    cv::Mat picture(kPlotHeight, kPlotWidth, CV_8UC3, cv::Scalar::all(255));
    DrawShapes(shapes, picture);
    WritePicture(file, picture);
  }
}

}  // namespace tutti::cli
