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

static void answer_configuration(struct db_web_request *request, json_t *parameters)
{
	struct db_web_caller caller = db_web_request_caller(request);
	const char *path = request->server->config->certificate_file;
	const char *slash = path ? strrchr(path, '/') : NULL;
	bool appoints = db_grant_has(&request->grant, DB_MAY_APPOINT, NULL);
	json_t *certificates;
	json_t *users = NULL;

	/* Answers by itself when the file of users cannot be read. */
	if (appoints) {
		users = db_web_users_list(request);
		if (!users)
			return;
	}
	db_plant_note(request->server->service->plant,
	              &(struct db_plant_note){
			      .kind = "users",
			      .what = "backup",
			      .user = caller.user,
			      .from = caller.from,
			      .text = appoints ? "the configuration and the names of users "
	                                         "were taken as a file" :
	                                         "the configuration was taken as a file",
		      });
	/* Names alone: a key never leaves its machine this way. */
	certificates = json_array();
	if (path && path[0] != '\0')
		(void)json_array_append_new(certificates, json_string(slash ? slash + 1 : path));
	db_web_request_answer(request, MHD_HTTP_OK,
	                      json_pack("{s:s, s:O, s:o?, s:o}", "version", DB_VERSION,
	                                "configuration", parameters, "users", users, "certificates",
	                                certificates));
}

void db_web_gateway(struct db_web_request *request)
{
	if (!db_grant_has(&request->grant, DB_MAY_MANAGE, NULL) &&
	    !db_grant_has(&request->grant, DB_MAY_APPOINT, NULL)) {
		db_web_request_refuse(request, MHD_HTTP_FORBIDDEN, "NotAllowed",
		                      "this needs the role administrator, or engineer of all "
		                      "drives");
		return;
	}
	db_web_log_action(request, "takes the gateway's state as a file", NULL);
	db_web_call_aside(request, "Configuration", json_object(), ANSWER_WITHIN,
	                  answer_configuration);
}
