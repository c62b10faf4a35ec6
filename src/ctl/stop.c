/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/stop.h"

int db_ctl_stop_drive(const struct db_ctl *ctl, const char *drive, struct db_client_error *error)
{
	struct db_client *client = NULL;
	json_t *answer = NULL;
	int failed = db_client_open(ctl->socket, &client, error);

	if (failed == 0)
		failed = db_client_call(client, "Run",
		                        json_pack("{s:s, s:s}", "drive", drive, "command", "stop"),
		                        DB_CTL_TIMEOUT_MS, &answer, error);
	json_decref(answer);
	db_client_close(client);
	return failed;
}
