# Several files are compiled as one, which is faster. gcc then warns of members whose type is in an
# anonymous namespace, as it takes that namespace for one of a header.
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_compile_options(-Wno-subobject-linkage)
endif()
