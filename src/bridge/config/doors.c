/* SPDX-License-Identifier: Apache-2.0 */
#include "config/config_private.h"

#include "drivebridge/config.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* All addresses of IPv4, as they are written in IPv6. */
#define V4_BITS 96

static bool has_everybody(const struct db_network *networks, size_t count)
{
	static const uint8_t v4[12] = { [10] = 0xFF, [11] = 0xFF };

	for (size_t i = 0; i < count; i++) {
		if (networks[i].prefix == 0 || (networks[i].prefix == V4_BITS &&
		                                memcmp(networks[i].address, v4, sizeof(v4)) == 0))
			return true;
	}
	return false;
}

/* `section` and `title` have the key allow-write; `head` is their line. */
static void warn_of_everybody(struct db_load *load, const char *section, const char *title,
                              unsigned head, const char *listen)
{
	/* Nobody reaches the loopback interface from elsewhere. */
	if (listen && strncmp(listen, "127.", 4) != 0 && strncmp(listen, "[::1]", 5) != 0 &&
	    strncmp(listen, "localhost:", 10) != 0)
		db_messages_add_warning(
			&load->messages,
			db_section_find_line(load, section, title, head, "allow-write"),
			"allow-write has everybody: whoever reaches %s moves the drives; give the "
			"addresses of the PLCs",
			listen);
}

static void check_file(struct db_load *load, const char *path)
{
	struct stat status;

	/* In a folder with the sticky bit nobody replaces files of others. */
	if (stat(path, &status) != 0 || (status.st_mode & S_IWOTH) == 0 ||
	    (S_ISDIR(status.st_mode) && (status.st_mode & S_ISVTX) != 0))
		return;
	db_messages_add_warning(
		&load->messages, 0,
		"%s can be written by everybody, who could so move the drives: chmod o-w %s", path,
		path);
}

void db_doors_check(struct db_load *load)
{
	const struct db_modbus_config *modbus = &load->config->modbus;
	const char *slash = load->path ? strrchr(load->path, '/') : NULL;
	char *folder;

	if (has_everybody(modbus->allow_write, modbus->allow_write_count))
		warn_of_everybody(load, "modbus", "", 0, modbus->listen);
	for (size_t i = 0; i < modbus->endpoint_count; i++) {
		const struct db_endpoint_config *endpoint = &modbus->endpoints[i];

		if (has_everybody(endpoint->allow_write, endpoint->allow_write_count))
			warn_of_everybody(load, "endpoint", endpoint->name, endpoint->source_line,
			                  endpoint->listen);
	}
	if (!load->path)
		return;
	/* All files, and the folder in which the first one could be replaced. */
	folder = slash ? strndup(load->path, (size_t)(slash - load->path) + 1) : strdup(".");
	if (folder)
		check_file(load, folder);
	free(folder);
	for (size_t i = 0; i < load->messages.source_count; i++)
		check_file(load, load->messages.sources[i].path);
	for (const char *at = load->profiles; at && *at; at += strlen(at) + 1)
		check_file(load, at);
}
