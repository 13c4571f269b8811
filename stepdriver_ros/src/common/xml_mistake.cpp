#include "xml_mistake.h"

#include <fmt/format.h>
#include <libxml/parser.h>
#include <libxml/xmlerror.h>

#include <algorithm>
#include <limits>
#include <memory>

#include "printable.h"

namespace stepdriver::ros_node {
namespace {

// The parser's messages quote names, which may be as long as the text.
constexpr std::size_t kLongestMessage = 200;

struct FreeContext {
  void operator()(xmlParserCtxt* context) const { xmlFreeParserCtxt(context); }
};

/// What the parser calls: the first mistake ends it.
class FirstMistake {
 public:
  explicit FirstMistake(xmlParserCtxt& context) : context_(context) {
    // Without handlers for the contents nothing of them is kept.
    *context.sax = xmlSAXHandler{};
    context.sax->initialized = XML_SAX2_MAGIC;
    context.sax->internalSubset = [](void* self, auto... /*name*/) {
      auto& mistake = *static_cast<FirstMistake*>(self);
      mistake.note(mistake.context_.input->line, mistake.context_.input->col,
                   "it has a document type declaration (<!DOCTYPE), which a robot description "
                   "doesn't need");
    };
    // The type of an error depends on the version of libxml2.
    context.sax->serror = [](void* self, auto* error) {
      if (error->level != XML_ERR_FATAL) return;
      static_cast<FirstMistake*>(self)->note(error->line, error->int2, error->message);
    };
    context.userData = this;
  }
  FirstMistake(const FirstMistake&) = delete;
  FirstMistake& operator=(const FirstMistake&) = delete;

  const std::string& text() const { return text_; }

 private:
  void note(int line, int column, const char* why) {
    if (text_.empty()) {
      std::string words = why == nullptr ? "" : why;
      while (!words.empty() && words.back() == '\n') words.pop_back();
      std::replace(words.begin(), words.end(), '\n', ' ');
      if (words.size() > kLongestMessage) words = words.substr(0, kLongestMessage) + "...";
      text_ = fmt::format("line {}, column {}: {}", line, column, printable(words));
    }
    xmlStopParser(&context_);
  }

  xmlParserCtxt& context_;
  std::string text_;
};

}  // namespace

std::string mistakeInXml(const std::string& xml) {
  if (xml.size() > std::numeric_limits<int>::max()) return "it is longer than 2 GB";
  const std::unique_ptr<xmlParserCtxt, FreeContext> context(xmlNewParserCtxt());
  if (!context) return "there is no memory to read it";
  const FirstMistake mistake(*context);
  xmlFreeDoc(xmlCtxtReadMemory(context.get(), xml.data(), static_cast<int>(xml.size()), nullptr,
                               "UTF-8", XML_PARSE_NONET | XML_PARSE_IGNORE_ENC));
  if (mistake.text().empty() && context->wellFormed == 0) return "it isn't well-formed XML";
  return mistake.text();
}

}  // namespace stepdriver::ros_node
