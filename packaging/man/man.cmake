# SPDX-License-Identifier: Apache-2.0
#
# Manual pages: NAME.in with @VERSION@ and @DATE@, and lines "@INCLUDE SCRIPT FILE...@" for what comes
# from the generated documents. Only sh and awk run, so that cross-building needs nothing else.

file(GLOB man_sources CONFIGURE_DEPENDS packaging/man/*.in)
file(GLOB man_scripts CONFIGURE_DEPENDS packaging/man/*.awk packaging/man/render)
set(man_pages)
foreach(source IN LISTS man_sources)
	cmake_path(GET source STEM LAST_ONLY page)
	string(REGEX MATCH "[0-9]$" section "${page}")
	if(page STREQUAL "drivebridge-opcua.8" AND NOT TARGET drivebridge-opcua)
		continue()
	endif()
	set(output ${CMAKE_CURRENT_BINARY_DIR}/man/${page})
	add_custom_command(OUTPUT ${output}
		COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/packaging/man/render
			${PROJECT_VERSION} ${source} ${output}
		DEPENDS ${source} ${man_scripts} docs/register-map.csv docs/commands.csv docs/config-keys.csv
			docs/drivebridgectl.csv docs/mqtt-keys.csv docs/web-keys.csv docs/opcua-keys.csv
			docs/tls-keys.csv
		WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}
		COMMENT "Manual page ${page}"
		VERBATIM)
	list(APPEND man_pages ${output})
	install(FILES ${output} DESTINATION ${CMAKE_INSTALL_MANDIR}/man${section})
endforeach()
add_custom_target(man ALL DEPENDS ${man_pages})
