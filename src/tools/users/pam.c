/* SPDX-License-Identifier: Apache-2.0 */
#include "users/pam.h"

#include <security/pam_appl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Answers each question that is not to be shown with the password; what else is asked (a second
 * factor by a text that is shown, a new password's repetition) has no answer here. */
static int converse(int count, const struct pam_message **messages, struct pam_response **answers,
                    void *data)
{
	struct pam_response *made;

	if (count < 1 || count > PAM_MAX_NUM_MSG)
		return PAM_CONV_ERR;
	made = calloc((size_t)count, sizeof(*made));
	for (int i = 0; made && i < count; i++) {
		int style = messages[i]->msg_style;

		if (style == PAM_PROMPT_ECHO_OFF)
			made[i].resp = strdup(data);
		if (style == PAM_PROMPT_ECHO_ON || (style == PAM_PROMPT_ECHO_OFF && !made[i].resp))
			goto fail;
	}
	*answers = made;
	return made ? PAM_SUCCESS : PAM_BUF_ERR;
fail:
	/* gcc's analyzer does not see that these are all answers. */
	for (int i = 0; i < count; i++)
		free(made[i].resp);
	free(made);
	return PAM_CONV_ERR;
}

/* PAM waits for seconds behind a wrong password; whoever calls limits attempts itself. */
static void do_not_wait(int status, unsigned delay, void *data)
{
	(void)status;
	(void)delay;
	(void)data;
}

bool db_pam_is_there(const char *folder)
{
	static const char *const folders[] = { "/etc/pam.d", "/usr/lib/pam.d" };
	char path[512];
	bool found = false;

	for (size_t i = 0; i < sizeof(folders) / sizeof(folders[0]) && !found; i++) {
		snprintf(path, sizeof(path), "%s/" DB_PAM_SERVICE, folder[0] ? folder : folders[i]);
		found = access(path, R_OK) == 0;
	}
	return found;
}

bool db_pam_check(const char *folder, const char *user, const char *password, char *why,
                  size_t size)
{
	const struct pam_conv conversation = {
		.conv = converse,
		.appdata_ptr = (void *)(uintptr_t)password,
	};
	union {
		void (*function)(int status, unsigned delay, void *data);
		const void *item;
	} delay = { .function = do_not_wait };
	pam_handle_t *handle = NULL;
	int status;

	why[0] = '\0';
	if (!db_pam_is_there(folder)) {
		snprintf(why, size, "PAM has no service " DB_PAM_SERVICE);
		return false;
	}
	status = folder[0] ?
	                 pam_start_confdir(DB_PAM_SERVICE, user, &conversation, folder, &handle) :
	                 pam_start(DB_PAM_SERVICE, user, &conversation, &handle);
	if (status == PAM_SUCCESS)
		(void)pam_set_item(handle, PAM_FAIL_DELAY, delay.item);
	if (status == PAM_SUCCESS)
		status = pam_authenticate(handle, PAM_SILENT | PAM_DISALLOW_NULL_AUTHTOK);
	if (status == PAM_SUCCESS)
		status = pam_acct_mgmt(handle, PAM_SILENT | PAM_DISALLOW_NULL_AUTHTOK);
	if (status != PAM_SUCCESS && status != PAM_AUTH_ERR && status != PAM_USER_UNKNOWN)
		snprintf(why, size, "PAM: %s",
		         handle ? pam_strerror(handle, status) : "cannot begin");
	if (handle)
		(void)pam_end(handle, status);
	return status == PAM_SUCCESS;
}
