/* SPDX-License-Identifier: Apache-2.0 */
#include "web/gateway.h"
#include "drivebridge/version.h"
#include "web/call.h"
#include "web/service.h"
#include "web/users.h"

#include <stdlib.h>
#include <string.h>

/* A disk that fails takes seconds. */
#define ANSWER_WITHIN (10 * DB_NS_PER_S)

struct reading {
	struct db_web_request *request;
	struct db_link *link;
};

static void end_reading(void *job)
{
	struct reading *reading = job;

	db_link_drop(reading->link);
	free(reading);
}

static void lose_link(void *data)
{
	/* Its call has been answered with that; the link is closed with the request. */
	(void)data;
}

/* Names alone: a key never leaves its machine this way. */
static json_t *list_certificates(const struct db_web_config *config)
{
	const char *path = config->certificate_file;
	const char *slash = path ? strrchr(path, '/') : NULL;
	json_t *names = json_array();

	if (path && path[0] != '\0')
		(void)json_array_append_new(names, json_string(slash ? slash + 1 : path));
	return names;
}

static void note(const struct db_web_request *request, bool with_users)
{
	struct db_web_caller caller = db_web_request_caller(request);

	db_web_service_note(request->server->service,
	                    &(struct db_link_note){
				    .kind = "users",
				    .what = "backup",
				    .user = caller.user,
				    .from = caller.from,
				    .text = with_users ? "the configuration and the names of users "
	                                                 "were taken as a file" :
	                                                 "the configuration was taken as a file",
			    });
}

static void on_configuration(void *data, json_t *parameters, const struct db_client_error *error,
                             bool more)
{
	struct reading *reading = data;
	struct db_web_request *request = reading->request;
	bool appoints = db_grant_has(&request->grant, DB_MAY_APPOINT, NULL);
	json_t *users = NULL;

	(void)more;
	if (error) {
		db_web_request_fail(request, error);
		return;
	}
	/* Answers by itself when the file of users cannot be read. */
	if (appoints) {
		users = db_web_users_list(request);
		if (!users)
			return;
	}
	note(request, appoints);
	db_web_request_answer(request, MHD_HTTP_OK,
	                      json_pack("{s:s, s:O, s:o?, s:o}", "version", DB_VERSION,
	                                "configuration", parameters, "users", users, "certificates",
	                                list_certificates(request->server->config)));
}

void db_web_gateway(struct db_web_request *request)
{
	struct db_client_error error = { .parameters = NULL };
	struct reading *reading;

	if (!db_grant_has(&request->grant, DB_MAY_MANAGE, NULL) &&
	    !db_grant_has(&request->grant, DB_MAY_APPOINT, NULL)) {
		db_web_request_refuse(request, MHD_HTTP_FORBIDDEN, "NotAllowed",
		                      "this needs the role administrator, or engineer of all "
		                      "drives");
		return;
	}
	db_web_log_action(request, "takes the gateway's state as a file", NULL);
	reading = calloc(1, sizeof(*reading));
	if (!reading) {
		db_web_request_refuse(request, MHD_HTTP_SERVICE_UNAVAILABLE, "Busy", "no memory");
		return;
	}
	reading->request = request;
	request->job = reading;
	request->end_job = end_reading;
	request->answer_by = db_client_now() + ANSWER_WITHIN;
	reading->link = db_web_service_open(request->server->service, lose_link, reading, &error);
	if (!reading->link)
		db_web_request_fail(request, &error);
	else if (db_link_send(reading->link, "Configuration", json_object(), false,
	                      on_configuration, reading) != 0)
		db_web_request_refuse(request, MHD_HTTP_BAD_GATEWAY, "ServiceUnreachable",
		                      "drivebridged cannot be reached");
	db_client_error_clear(&error);
}
