/* SPDX-License-Identifier: Apache-2.0 */
#include "users/roles.h"

const char *db_role_name(enum db_role role)
{
	static const char *const names[] = { "none", "reader", "operator" };

	return names[role];
}
