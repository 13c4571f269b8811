# Several files are compiled as one, which takes half the time: most of it goes to the headers. With
# -DCMAKE_UNITY_BUILD=OFF each is compiled alone, and less after a change of one.
if(NOT DEFINED CMAKE_UNITY_BUILD)
  set(CMAKE_UNITY_BUILD ON)
endif()
# gcc then warns of members whose type is in an anonymous namespace, as it takes that namespace for one of a
# header.
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_compile_options(-Wno-subobject-linkage)
endif()
