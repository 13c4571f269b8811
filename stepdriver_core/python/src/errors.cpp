#include "errors.h"

#include <pybind11/pybind11.h>

#include <exception>
#include <stdexcept>
#include <string>

#include "stepdriver_core/error.h"

namespace stepdriver::python {
namespace {

namespace py = pybind11;

py::object kindOf(const char* name) {
  return py::module_::import("stepdriver_core._errors").attr(name);
}

void raise(const char* kind, const char* text) {
  PyErr_SetObject(kindOf(kind).ptr(), py::str(text).ptr());
}

void raise(const ConfigError& error) {
  const py::object issue = kindOf("ConfigIssue");
  py::list issues;
  for (const ConfigIssue& one : error.issues()) {
    issues.append(issue(one.key, one.message, one.may_be_left_over));
  }
  const py::object kind = kindOf("ConfigError");
  PyErr_SetObject(kind.ptr(), kind(error.what(), py::tuple(issues)).ptr());
}

// pybind11 passes a copy.
void translate(std::exception_ptr pointer) {  // NOLINT(performance-unnecessary-value-param)
  try {
    if (pointer) std::rethrow_exception(pointer);
  } catch (const ConfigError& error) {
    raise(error);
  } catch (const Refused& error) {
    raise("Refused", error.what());
  } catch (const GpioError& error) {
    raise("GpioError", error.what());
  } catch (const StateFileError& error) {
    raise("StateFileError", error.what());
  } catch (const py::cast_error& error) {
    PyErr_SetString(PyExc_TypeError, error.what());
  } catch (const py::builtin_exception&) {
    throw;  // such as a TypeError, which pybind11 knows
  } catch (const py::error_already_set&) {
    throw;
  } catch (
      const std::runtime_error& error) {  // or of the system, such as a thread that can't start
    raise("Error", error.what());
  }
}

}  // namespace

void translateErrors() { py::register_exception_translator(&translate); }

}  // namespace stepdriver::python
