/* SPDX-License-Identifier: Apache-2.0 */
/* What of a browser's request is decoded here, and the file of users: lines of the input are path, host, origin, cookie,
 * network; all of it is the file. Nobody gets in by its form. */
#include "users/users.h"
#include "web/address.h"
#include "web/origin.h"
#include "web/route.h"
#include "web/sessions.h"
#include "web/tabs.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check_host(const char *host, const char *origin)
{
	const struct db_setting_list none = { .names = NULL };
	char whole[512];

	/* Without names in the configuration nothing but addresses and localhost gets through. */
	if (db_web_host_is_good(host, &none) && strlen(host) > 280)
		abort();
	if (strlen(host) < 400) {
		(void)snprintf(whole, sizeof(whole), "https://%s", host);
		if (!db_web_origin_is_good(whole, host))
			abort();
	}
	if (db_web_origin_is_good(origin, host) && !strstr(origin, "://"))
		abort();
}

static void check_path(const char *path)
{
	struct db_web_route get = db_web_route_find("GET", path);
	struct db_web_route post = db_web_route_find("POST", path);

	if (get.kind == DB_WEB_FILE && (strchr(get.name, '/') || get.name[0] == '\0'))
		abort();
	if (post.acts && post.needs <= DB_MAY_LOOK)
		abort();
	if (get.acts || get.kind == DB_WEB_CALL || get.kind == DB_WEB_STREAM)
		abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	char *text = calloc(1, size + 1);
	char *lines[5];
	struct db_users users;
	struct db_web_sessions *sessions = db_web_sessions_new(1, 1);
	struct db_web_address address = { { 0 } };
	struct sockaddr_storage endpoint;
	socklen_t length;
	char *rest;

	if (!text || !sessions)
		abort();
	if (size > 0)
		memcpy(text, data, size);
	(void)db_users_parse(&users, text, "users", NULL);
	for (size_t i = 0; i < users.count; i++) {
		if (!db_users_name_is_good(users.list[i].name) ||
		    users.list[i].grant.role == DB_ROLE_NONE ||
		    !db_drives_are_good(users.list[i].grant.drives) ||
		    users.list[i].hash[0] != (users.list[i].pam ? '\0' : '$') ||
		    db_users_find(&users, users.list[i].name) != &users.list[i])
			abort();
	}
	db_users_clear(&users);
	rest = text;
	for (size_t i = 0; i < sizeof(lines) / sizeof(lines[0]); i++) {
		char *end = rest + strcspn(rest, "\n");

		lines[i] = rest;
		rest = *end ? end + 1 : end;
		*end = '\0';
	}
	check_path(lines[0]);
	check_host(lines[1], lines[2]);
	if (db_web_sessions_find(sessions, lines[3], 0))
		abort();
	(void)db_web_tabs_judge(lines[3], NULL);
	(void)db_web_tabs_judge(NULL, lines[3]);
	if (db_web_address_parse(lines[4], &address) && !db_web_network_is_good(lines[4]))
		abort();
	(void)db_web_endpoint_parse(lines[4], &endpoint, &length);
	db_web_sessions_free(sessions);
	free(text);
	return 0;
}
